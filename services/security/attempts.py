"""Limit on wrong tokens, by address."""

from collections import OrderedDict
from dataclasses import dataclass, field

MOST_ATTEMPTS = 10.0
"""So many wrong tokens in a row are answered as such."""
ATTEMPT_S = 6.0
"""After this time one more is. [s]"""
MOST_ADDRESSES = 10_000
"""Addresses that are remembered, the last ones; about 1 MB."""


def is_news(wait_s: float) -> bool:
    """Whether a wrong token, after which its sender has to wait so long, is within the limit or the first beyond it.

    Examples
    --------
    >>> attempts = Attempts()
    >>> sum(is_news(attempts.note("192.0.2.7", now_s=0.0)) for _ in range(100))
    11
    """
    return wait_s <= ATTEMPT_S


@dataclass(slots=True)
class Attempts:
    """Wrong tokens of each address, as a bucket that leaks one in `ATTEMPT_S`.

    A right token is never refused: whoever tries wrong ones behind the same proxy must not lock the control room
    out, and 256 random bits are not found by trying.
    """

    _wrong: OrderedDict[str, tuple[float, float]] = field(default_factory=OrderedDict)

    def note(self, address: str, now_s: float) -> float:
        """Count a wrong token, and return how long its sender has to wait, 0 within the limit. [s].

        Examples
        --------
        >>> attempts = Attempts()
        >>> [attempts.note("192.0.2.7", now_s) for now_s in [0.0] * 11 + [60.0]][-3:]
        [0.0, 6.0, 0.0]
        """
        level, noted_s = self._wrong.pop(address, (0.0, now_s))
        level = max(level - (now_s - noted_s) / ATTEMPT_S, 0.0) + 1.0
        self._wrong[address] = (min(level, MOST_ATTEMPTS + 1.0), now_s)
        if len(self._wrong) > MOST_ADDRESSES:
            self._wrong.popitem(last=False)
        return max(level - MOST_ATTEMPTS, 0.0) * ATTEMPT_S
