"""What is said of the gap: verdict, place, shrinkage, report."""
