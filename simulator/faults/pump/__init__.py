"""Faults of a pump."""
