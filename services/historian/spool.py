"""What waits in memory for the store."""

import threading
from collections import deque
from collections.abc import Sequence

from wetwell.services.historian.rows import SampleRow
from wetwell.services.historian.store.interface import EventRow

Row = SampleRow | EventRow


class Spool:
    """Rows that wait, oldest first. All is counted in samples, verdicts and alarms.

    Characteristics: when full the oldest rows are given up and counted, but never the last one, however many samples
    it has · any thread may call.

    Parameters
    ----------
    most : int
        What may wait, >= 1.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._rows: deque[Row] = deque()
        self._lock = threading.Lock()
        self.waiting = 0
        self.lost = 0

    def put(self, rows: Sequence[Row]) -> None:
        """Let rows wait behind the others."""
        with self._lock:
            self._rows.extend(rows)
            self._grow(rows)

    def put_back(self, rows: Sequence[Row]) -> None:
        """Let rows that were taken wait again, before all others."""
        with self._lock:
            self._rows.extendleft(reversed(rows))
            self._grow(rows)

    def pop(self, most: int) -> list[Row]:
        """The oldest rows, until they are so many samples, verdicts and alarms or a row more; empty if none wait."""
        rows: list[Row] = []
        taken = 0
        with self._lock:
            while self._rows and taken < most:
                rows.append(self._rows.popleft())
                taken += rows[-1].size
            self.waiting -= taken
        return rows

    def _grow(self, rows: Sequence[Row]) -> None:
        self.waiting += size_of(rows)
        while self.waiting > self._most and len(self._rows) > 1:
            given_up = self._rows.popleft().size
            self.waiting -= given_up
            self.lost += given_up


def size_of(rows: Sequence[Row]) -> int:
    """Number of samples, verdicts and alarms."""
    return sum(row.size for row in rows)
