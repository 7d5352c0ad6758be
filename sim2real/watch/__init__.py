"""A gap that is watched: a look a day, a diagnosis where it has changed, and what it is called since when."""
