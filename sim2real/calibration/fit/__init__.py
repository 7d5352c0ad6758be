"""Regularised fits: datasheets as prior, noise that comes in runs."""
