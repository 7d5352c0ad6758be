"""`wetwell doctor`: looks at a running site as its clients see it, and says what is wrong and what to do."""
