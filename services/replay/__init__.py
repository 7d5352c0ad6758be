"""The replay daemon."""
