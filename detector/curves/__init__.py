"""Curves by the datasheet, distances from them, and what a wrong sensor does to those."""
