"""Messages on the bus, and what is measured in one second."""
