"""Effects in the wet well."""
