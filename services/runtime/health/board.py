"""The last health figures of the services of this process, and whether they do their duty."""

import re
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from wetwell.services.runtime.health.metrics import METRICS

MAX_ENTRIES = 10_000
"""Further services are left out: somebody makes them up."""
DROP_S = 60.0
"""So long after it a drop of messages counts."""
SLACK_S = 5.0


@dataclass(frozen=True)
class Entry:
    """What one service has said last. `told_s` and `dropped_s`: when it did, and when it dropped messages last."""

    figures: dict[str, float]
    period_s: float
    told_s: float
    dropped_s: float | None


class HealthBoard(Collector):
    """Figures by station and service; the same that go into the status messages. Any thread may read.

    `others` are further collectors of this process, for the same page.

    Parameters
    ----------
    clock : callable
        Clock that nobody sets. [s]

    Examples
    --------
    >>> board = HealthBoard(lambda: 0.0)
    >>> board.reasons(60.0)
    ['nothing is told yet: no router?']
    >>> board.report("alpha", "detector", 10.0, {"sample_age_s": 75.0, "dropped": 0.0})
    >>> board.reasons(60.0)
    ["detector of 'alpha': no sample for 75 s"]
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self.others: list[Collector] = []
        self._entries: dict[tuple[str, str], Entry] = {}
        self._lock = threading.Lock()

    def report(self, station: str, service: str, period_s: float, figures: dict[str, float]) -> None:
        """Take the figures of a service, which are told each `period_s`."""
        now_s, name = self._clock(), (station, service)
        with self._lock:
            if name not in self._entries and len(self._entries) >= MAX_ENTRIES:
                return
            before = self._entries.get(name)
            dropped_s = None if before is None else before.dropped_s
            if figures.get("dropped", 0.0) > (0.0 if before is None else before.figures.get("dropped", 0.0)):
                dropped_s = now_s
            self._entries[name] = Entry(dict(figures), period_s, now_s, dropped_s)

    def reasons(self, max_sample_age_s: float) -> list[str]:
        """Why this process does not do its duty; empty if it does."""
        with self._lock:
            entries = sorted(self._entries.items())
        if not entries:
            return ["nothing is told yet: no router?"]
        return [
            f"{service} of '{station}': {reason}"
            for (station, service), entry in entries
            for reason in self._faults(entry, max_sample_age_s)
        ]

    def _faults(self, entry: Entry, max_sample_age_s: float) -> Iterable[str]:
        now_s = self._clock()
        silent_s = now_s - entry.told_s
        if silent_s > 3.0 * entry.period_s + SLACK_S:
            yield f"stands still, nothing told for {silent_s:.0f} s"
        yield from figure_faults(entry.figures, max_sample_age_s)
        if entry.dropped_s is not None and now_s - entry.dropped_s <= DROP_S:
            yield "too slow, messages were dropped within the last minute"

    def collect(self) -> Iterable[Metric]:
        """Figures as Prometheus takes them."""
        with self._lock:
            entries = sorted(self._entries.items())
        for figure in sorted({figure for _, entry in entries for figure in entry.figures}):
            name = re.sub(r"[^a-zA-Z0-9_]", "_", figure)
            family = GaugeMetricFamily(f"wetwell_{name}", METRICS.get(figure, ""), labels=("station", "service"))
            for labels, entry in entries:
                if figure in entry.figures:
                    family.add_metric(labels, entry.figures[figure])
            yield family
        for other in self.others:
            yield from other.collect()


def figure_faults(figures: dict[str, float], max_sample_age_s: float) -> list[str]:
    """What the figures of a service say against it by themselves.

    Examples
    --------
    >>> figure_faults({"sample_age_s": 5.0, "disk_errors": 2.0}, 60.0)
    ['2 writes to disk failed in a row']
    """
    faults = []
    if figures.get("sample_age_s", 0.0) > max_sample_age_s:
        faults.append(f"no sample for {figures['sample_age_s']:.0f} s")
    if figures.get("is_failing", 0.0) > 0.0:
        faults.append("the database or its disk refuses what is to be kept")
    if figures.get("disk_errors", 0.0) > 0.0:
        faults.append(f"{figures['disk_errors']:.0f} writes to disk failed in a row")
    return faults


BOARD = HealthBoard()
"""That of this process."""
