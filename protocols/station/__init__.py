"""Station file: what the owner of a pump station knows of it."""
