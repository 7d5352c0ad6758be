"""What `import wetwell` gives: recordings, verdicts, fits and diagnoses in Python, a noun a file."""
