"""The watch of the gap: looks at what the historian has kept, tells how far each station is from its simulator."""
