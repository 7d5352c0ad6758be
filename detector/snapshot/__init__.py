"""The state of a detector as bytes, and those of older versions."""
