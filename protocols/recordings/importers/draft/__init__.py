"""Draft of a mapping: what an export looks like, which tags are which signals, what was assumed."""
