"""When something could get from one place to another: what had time for it must be there."""

from bisect import bisect_left
from collections.abc import Iterable, Sequence

from network import Sent
from simulated_site import Site, Span

MARGIN_S = 60.0
"""For delays, what comes from a cache, and a clock with a grain."""


def blocked(spans: Iterable[Span], names: Sequence[str], whats: Sequence[str]) -> list[tuple[float, float]]:
    """When any of these was kept from working by any of that; in order, joined."""
    joined: list[tuple[float, float]] = []
    for span in sorted((one.begin_s, one.end_s) for one in spans if one.name in names and one.what in whats):
        if joined and span[0] <= joined[-1][1]:
            joined[-1] = joined[-1][0], max(joined[-1][1], span[1])
        else:
            joined.append(span)
    return joined


class Way:
    """The way of messages from a sender to a receiver, and how much time one must have had to be there.

    Parameters
    ----------
    site : Site
    sender, receiver : str
    least_s : float
        So long nothing must be in the way at a stretch. [s]
    """

    def __init__(self, site: Site, sender: str, receiver: str, least_s: float) -> None:
        spans = [
            *blocked(site.spans, [sender], ["mute", "stalled"]),
            *blocked(site.spans, [receiver, "machine"], ["away", "deaf", "stalled", "full", "slow"]),
        ]
        self._spans = blocked([Span("", "", *span) for span in spans], [""], [""])
        self._begins = [begin for begin, _ in self._spans]
        self._least_s = least_s

    def is_open(self, begin_s: float, end_s: float) -> bool:
        """Whether there was a stretch that was long enough."""
        return self.free_s(begin_s, end_s) is not None

    def free_s(self, begin_s: float, end_s: float) -> float | None:
        """When the first stretch began that was long enough; None if there was none. [s]"""
        free_s = begin_s
        for begin, end in self._spans[max(0, bisect_left(self._begins, begin_s) - 1) :]:
            if min(begin, end_s) - free_s >= self._least_s:
                return free_s
            if begin >= end_s:
                return None
            free_s = max(free_s, end)
        return free_s if end_s - free_s >= self._least_s else None


def until_s(sent: Sequence[Sent], place: int, history: int) -> float:
    """Until when a message can be had from its sender: it dies, or keeps so many newer ones."""
    one = sent[place]
    newer = sent[place + history] if place + history < len(sent) else None
    expires_s = newer.at_s if newer is not None and newer.bus is one.bus else float("inf")
    return min(one.bus.died_s, expires_s)
