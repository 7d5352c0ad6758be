"""The channels of a subscription, each looked into when its next message is due."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence

import zenoh

TURN = 5_000
"""Messages that are taken from one channel before the others have their turn."""
EARLY = 0.8
"""Share of the pause between two messages of a channel for which it is left alone after the second."""
LONGEST_REST_S = 0.8
"""It is never left alone for longer: Zenoh's threads wait where a channel is full. [s]"""
QUIET_S = 5.0
"""A channel without a message for so long is looked into now and then only. [s]"""
QUIET_REST_S = 0.25
SLOT_S = 0.05
"""Channels that rest are woken in groups of this length, at the beginning of it. [s]"""
FEW = 64
"""So many channels are looked into each time."""

Receive = Callable[[], zenoh.Sample | None]


class Channel:
    """A channel that Zenoh's threads fill, and the rhythm of what comes."""

    __slots__ = ("count", "heard_s", "receive")

    def __init__(self, receive: Receive) -> None:
        self.receive = receive
        self.heard_s = float("-inf")
        self.count = 0

    def rest_s(self, now_s: float) -> float:
        """Time in s for which nothing is to be expected of it; `count` messages have just been taken."""
        silent_s = now_s - self.heard_s
        if not self.count:
            return QUIET_REST_S if silent_s > QUIET_S else 0.0
        pause_s = silent_s / self.count
        self.heard_s, self.count = now_s, 0
        return 0.0 if pause_s > QUIET_S else min(EARLY * pause_s, LONGEST_REST_S)


class Channels:
    """Channels of a subscription.

    A look into an empty channel costs .25 µs: with a thousand of them two hundred times a second a twentieth of a
    core. Stations have a rhythm: after a message its channel rests for most of the pause before it. What comes
    early waits until then, by a fifth of that pause or .8 s at most.

    Parameters
    ----------
    receivers : sequence of callable
        Each gives the next message of its channel, or None.
    has_rhythm : bool
        Whether each channel has one publisher. Others, and a few, are looked into each time.
    """

    def __init__(self, receivers: Sequence[Receive], *, has_rhythm: bool) -> None:
        self._awake = [Channel(receive) for receive in receivers]
        self._resting: defaultdict[int, list[Channel]] = defaultdict(list)
        self._rests = has_rhythm and len(receivers) > FEW
        self._slot = 0

    def messages(self, now_s: float) -> Iterator[zenoh.Sample]:
        """Yield what has come, of each channel in its order; to be taken to the end."""
        before, woken = self._slot, self._woken(now_s)
        looked = self._awake = self._awake + woken if woken else self._awake
        has_news = self._slot != before
        for channel in looked:
            left = TURN
            while left and (sample := channel.receive()) is not None:
                left -= 1
                channel.count += 1
                has_news = True
                yield sample
        if self._rests and has_news:
            self._awake = [channel for channel in looked if not self._rest(channel, now_s)]

    def _woken(self, now_s: float) -> list[Channel]:
        """Channels whose rest is over."""
        self._slot = int(now_s / SLOT_S)
        over = [slot for slot in self._resting if slot <= self._slot]
        return [channel for slot in over for channel in self._resting.pop(slot)]

    def _rest(self, channel: Channel, now_s: float) -> bool:
        """Let a channel rest if it may; whether it does."""
        slot = int((now_s + channel.rest_s(now_s)) / SLOT_S)
        if slot == self._slot:
            return False
        self._resting[slot].append(channel)
        return True
