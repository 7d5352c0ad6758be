"""The commands of `wetwell`, one file a group; each parses and calls, nothing else."""
