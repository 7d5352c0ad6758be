"""Faults of the rising main."""
