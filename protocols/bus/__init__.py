"""The bus: what a link is, who may do what on it, and messages in order, each once."""
