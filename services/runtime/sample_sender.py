"""Samples of one station onto the bus: each by itself, or gathered into messages of many."""

import asyncio
import math

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.bus.keys import sample_block_key, sample_key
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.sample_block import MOST_SAMPLES, SampleBlock

LEAST_KEPT = 600
"""Samples that the bus keeps for late joiners: ten minutes at one a second."""
LEAST_KEPT_S = 120.0
"""Time on the wall for which it keeps them at least, however fast the station runs: a process is back by then. [s]"""


class SampleSender:
    """Sends the samples of a station in their order.

    Parameters
    ----------
    bus : Bus
    station : str
    gather_s : float
        So long samples are gathered into one message; with 0 each is sent at once, by itself. [s]
    rate_hz : float
        Samples a second on the wall, at most: by it the bus keeps as many as it takes. [Hz]

    Notes
    -----
    To be used within one event loop. What is gathered is lost if the process is killed; call `flush` before it ends.
    """

    def __init__(self, bus: Bus, station: str, gather_s: float, rate_hz: float = 1.0) -> None:
        self._gather_s = gather_s
        self._gathered: list[Sample] = []
        self._timer: asyncio.TimerHandle | None = None
        key = sample_block_key(station) if gather_s else sample_key(station)
        self._publisher = bus.publisher(key, history=max(LEAST_KEPT, math.ceil(LEAST_KEPT_S * rate_hz)))

    def put(self, sample: Sample) -> None:
        """Send a sample, or gather it."""
        if not self._gather_s:
            self._publisher.put(sample.encode())
            return
        if self._gathered and _kind(sample) != _kind(self._gathered[0]):
            self.flush()
        self._gathered.append(sample)
        if len(self._gathered) == MOST_SAMPLES:
            self.flush()
        elif self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(self._gather_s, self.flush)

    def flush(self) -> None:
        """Send what is gathered."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._gathered:
            self._publisher.put(SampleBlock.of(self._gathered).encode(), len(self._gathered))
            self._gathered = []


def _kind(sample: Sample) -> tuple[str, int]:
    """What the samples of a message have in common."""
    return sample.quality, len(sample.pumps)
