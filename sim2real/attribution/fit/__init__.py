"""Fits of candidates: where they stand, what a fit makes small, and the way there."""
