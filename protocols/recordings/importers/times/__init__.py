"""Stamps of an export: their form, and local time with daylight saving turned into UTC."""
