"""What the page asks of the other services: history, recordings, acts."""
