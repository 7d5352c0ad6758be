"""The language everybody speaks: station file, messages, keys, registers, recordings, links."""
