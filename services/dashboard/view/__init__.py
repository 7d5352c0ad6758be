"""What the page knows of the site and of each station, and what is new of it."""
