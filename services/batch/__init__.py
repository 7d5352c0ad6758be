"""Work on files, by one process or many."""
