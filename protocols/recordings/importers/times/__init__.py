"""Stamps of an export, and their form."""
