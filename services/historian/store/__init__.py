"""Stores of the historian: a folder of SQLite and Parquet, or PostgreSQL."""
