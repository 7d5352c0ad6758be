"""What the cells of a fit say of it: its evidence, and whether each of its effects is there and matters."""
