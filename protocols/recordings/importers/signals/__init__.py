"""Signals of a recording out of the cells of an export: numbers and words, events, rows."""
