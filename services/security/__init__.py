"""Who may look and act: tokens, roles, what may listen beyond this machine."""
