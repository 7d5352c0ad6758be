"""How far the replay is from the recording."""
