"""Writes of Modbus clients to the simulated PLC, in the audit."""

import time
from collections.abc import Mapping

from wetwell.services.runtime.clock import now_ns
from wetwell.services.security.attempts import Attempts, is_news
from wetwell.services.security.audit import Audit


class WriteLog:
    """Notes each write that has changed something, and who was refused.

    Of refused writes of an address, one more is noted in six seconds, after the first ten: it cannot fill the disk.

    Parameters
    ----------
    audit : Audit
    station : str
    """

    def __init__(self, audit: Audit, station: str) -> None:
        self._audit = audit
        self._station = station
        self._refused = Attempts()

    def note(self, client: str, changes: Mapping[str, float], refused: str) -> None:
        """Write down what a client has written, or why it was refused."""
        if refused and not is_news(self._refused.note(client, time.monotonic())):
            return
        more = {"refused": refused} if refused else {}
        self._audit.note(
            now_ns(), act="modbus write", station=self._station, address=client, values=dict(changes), **more
        )
