"""Learnt corrections: what they are made of, and how they act in the plant."""
