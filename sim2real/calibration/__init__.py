"""A station file fitted to a recording, and the fit checked."""
