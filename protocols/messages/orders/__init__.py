"""Orders of people: to the detector, and to the clock of a simulated plant."""
