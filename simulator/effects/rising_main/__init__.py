"""Effects in the rising main."""
