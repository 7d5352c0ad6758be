"""The edges: daemons, settings and the command line."""
