"""The control-room page: what is on the bus, in a browser."""
