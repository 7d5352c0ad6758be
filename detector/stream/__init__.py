"""What each sample goes through, compiled: gate, run state, drawdown, stuck and missing signals."""
