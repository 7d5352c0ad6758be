"""Which effects explain the residuals."""
