"""Effects in sensors and telemetry."""
