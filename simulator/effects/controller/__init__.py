"""Effects in the controller."""
