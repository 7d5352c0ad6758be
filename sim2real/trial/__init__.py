"""The withheld check: sealed truths, diagnoses that see only station and recording, scores."""
