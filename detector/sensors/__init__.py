"""Faults of sensors that a run shows."""
