"""Verdicts held against truth; no part of the detector's own way."""
