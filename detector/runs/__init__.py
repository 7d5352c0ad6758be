"""From steady samples to pump runs."""
