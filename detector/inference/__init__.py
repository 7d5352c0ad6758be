"""From a run to the probability of each cause."""
