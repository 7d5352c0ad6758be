"""What every daemon needs: settings, life cycle, clock, connection to the bus, logs, health."""
