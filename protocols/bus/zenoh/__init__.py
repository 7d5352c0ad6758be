"""The bus over Zenoh, the only importer of its library."""
