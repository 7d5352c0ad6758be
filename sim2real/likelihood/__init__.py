"""How probable a recording is under a set of effects: noise, what a right model may miss, and what it is worth."""
