"""The plant: hydraulics, wet well, control, drive, sensors, inflow and faults at one-second steps."""
