"""The watch of the gap on files: over a history, and as the prior of a fleet."""
