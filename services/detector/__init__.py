"""The detector daemon: samples from the bus in, verdicts on the bus out."""
