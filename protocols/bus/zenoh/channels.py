"""The channels of a subscription, each looked into when its next message is due."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from itertools import chain

import zenoh

TURN = 5_000
"""Messages that are taken from one channel before the others have their turn."""
EARLY = 0.8
"""Share of the rhythm of a channel for which it is left alone after a message that was in time."""
EARLY_S = 0.2
"""Of a slow rhythm all but the last so many seconds. [s]"""
SLOWER = 1.1
"""A rhythm is the shortest of the last pauses; it may become slower by this factor with each message."""
LONGEST_REST_S = 0.8
"""It is never left alone for longer at a time: Zenoh's threads wait where a channel is full. [s]"""
SLOWEST_S = 60.0
"""Messages that are further apart have no rhythm. [s]"""
QUIET_S = 5.0
"""A channel without a message for so long, and for so many of its rhythms, is looked into now and then only. [s]"""
QUIET_RHYTHMS = 1.5
QUIET_REST_S = 0.25
STIRRED_S = 2.0
"""After one that was silent has spoken the others are looked into each time for so long: where a link is back or a
gateway begins, all of them speak. [s]"""
CALM_S = 60.0
"""From one such time to the next, where some speak seldom. [s]"""
SLOT_S = 0.05
"""Channels that rest are woken in groups of this length, at the beginning of it. [s]"""
FEW = 64
"""So many channels are looked into each time. As many messages tell how fast all of them are."""

Receive = Callable[[], zenoh.Sample | None]


class Channel:
    """A channel that Zenoh's threads fill, and the rhythm of what comes."""

    __slots__ = ("count", "due_s", "heard_s", "quiet_s", "receive", "rhythm_s")

    def __init__(self, receive: Receive) -> None:
        self.receive = receive
        self.heard_s = float("-inf")
        self.rhythm_s = float("inf")
        self.count = 0
        self.due_s = float("-inf")
        self.quiet_s = float("-inf")

    def heed(self, now_s: float) -> None:
        """Learn from the `count` messages that have just been taken when the next is due, and until when to wait.

        By so much as the last one was late the next one comes sooner.
        """
        silent_s, count = now_s - self.heard_s, self.count
        self.heard_s, self.count = now_s, 0
        pause_s = silent_s / count
        if pause_s > SLOWEST_S:
            self.due_s, self.quiet_s = now_s, now_s + QUIET_S
            return
        usual_s, self.rhythm_s = min(pause_s, self.rhythm_s), min(pause_s, SLOWER * self.rhythm_s)
        late_s = silent_s - count * usual_s
        self.due_s = now_s + max(EARLY * usual_s, usual_s - EARLY_S) - late_s
        self.quiet_s = now_s + max(QUIET_S, QUIET_RHYTHMS * self.rhythm_s)


class Channels:
    """Channels of a subscription.

    A look into an empty channel costs .25 µs: with a thousand of them two hundred times a second a twentieth of a
    core. Stations have a rhythm: after a message its channel rests until shortly before the next one is due, with a
    look each .8 s. What comes earlier waits until then, by .8 of the rhythm or .8 s at most.

    Parameters
    ----------
    receivers : sequence of callable
        Each gives the next message of its channel, or None.
    has_rhythm : bool
        Whether each channel has one publisher. Others, and a few, are looked into each time.

    Attributes
    ----------
    rate_hz : float
        Messages of a channel in a second, as the last messages show it; infinite of those that are looked into each
        time. [1/s]
    """

    def __init__(self, receivers: Sequence[Receive], *, has_rhythm: bool) -> None:
        self._awake = [Channel(receive) for receive in receivers]
        self._resting: defaultdict[int, list[Channel]] = defaultdict(list)
        self._rests = has_rhythm and len(receivers) > FEW
        self._slot = 0
        self._stirred_s = float("-inf")
        self.rate_hz = 1.0 if self._rests else float("inf")

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
        if channel.count:
            if now_s > channel.quiet_s and now_s - self._stirred_s > CALM_S:
                self._stir(now_s)
            channel.heed(now_s)
            if channel.rhythm_s < SLOWEST_S:  # of a first message nobody knows when the next one comes
                self.rate_hz += (1.0 / channel.rhythm_s - self.rate_hz) / FEW
        if now_s < channel.due_s:
            rest_s = min(channel.due_s - now_s, LONGEST_REST_S)
        elif now_s > channel.quiet_s and now_s - self._stirred_s > STIRRED_S:
            rest_s = QUIET_REST_S
        else:
            return False
        slot = int((now_s + rest_s) / SLOT_S)
        if slot == self._slot:
            return False
        self._resting[slot].append(channel)
        return True

    def _stir(self, now_s: float) -> None:
        """Let all channels be woken with the next look."""
        self._stirred_s = now_s
        self._resting = defaultdict(list, {self._slot: list(chain.from_iterable(self._resting.values()))})
