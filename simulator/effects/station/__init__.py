"""Effects that may lie in any part of the station."""
