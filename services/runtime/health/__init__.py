"""Health of a process over HTTP: `/metrics` for Prometheus, `/healthz` for whoever restarts it."""
