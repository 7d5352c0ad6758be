"""What the simulator says for a recording."""
