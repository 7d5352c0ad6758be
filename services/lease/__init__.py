"""Pairs of daemons: one owner at a time, by a lease in PostgreSQL, and a ledger of what it tells and keeps."""
