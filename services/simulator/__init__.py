"""The simulator daemon."""
