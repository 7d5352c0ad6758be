"""What to do next: acts at the station that tell apart what a diagnosis leaves, and what they cost."""
