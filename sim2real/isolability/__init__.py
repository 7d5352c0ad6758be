"""What can be told apart by which signals: signatures of effects and faults at a station's duty points."""
