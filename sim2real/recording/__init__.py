"""The recording that is held against the simulator: prepared, on whole seconds, in regimes."""
