"""Requests that cannot be answered."""

from wetwell.protocols.errors import WetwellError


class RefusalError(WetwellError):
    """A request that cannot be answered, with the status of HTTP that says why."""

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status = status
