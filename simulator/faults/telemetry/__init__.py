"""Faults of sensors and PLC."""
