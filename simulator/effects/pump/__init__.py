"""Effects in a pump."""
