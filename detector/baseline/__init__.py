"""What a healthy pump shows: model and learning phase."""
