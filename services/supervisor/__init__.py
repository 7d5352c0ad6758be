"""The whole service on one machine: the router here, the other parts as children; what `wetwell up` does."""
