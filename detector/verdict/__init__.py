"""What a verdict says: evidence, severity, control limits, maintenance."""
