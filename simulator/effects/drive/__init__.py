"""Effects in drive and supply."""
