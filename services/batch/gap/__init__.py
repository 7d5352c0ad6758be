"""Diagnoses of files: one, many, the next experiment, and a new effect made from one."""
