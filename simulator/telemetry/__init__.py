"""From true values to telemetry: channels, sensors, what is sent when."""
