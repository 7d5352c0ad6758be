"""An equation for what no effect of the library explains: one term of the model, and what it goes with."""
