"""The SQLite database of the live days."""
