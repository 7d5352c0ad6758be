"""One subscription of a Zenoh bus."""

import logging
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import zenoh

from wetwell.protocols.bus.interface import PACE_S
from wetwell.protocols.bus.keys import tail_key
from wetwell.protocols.bus.mailbox import Mailbox
from wetwell.protocols.bus.publisher_cache import Page
from wetwell.protocols.bus.sequencer import Sequencer, SourceStream
from wetwell.protocols.bus.zenoh.channels import Channels, Receive
from wetwell.protocols.bus.zenoh.session import at_once
from wetwell.protocols.bus.zenoh.sessions import Line, Sessions

logger = logging.getLogger(__name__)

CHANNEL = 4_096
"""Messages that Zenoh's threads may put into the channels of a subscription while Python is busy; then they wait, and
routers drop. Each can hold on to a buffer of 64 kB in which it came, so that 100,000 of them were 6 GB."""
LEAST_CHANNEL = 64
"""Of each of many channels: a minute of samples."""
MANY = CHANNEL // 4
"""After so many at once the channels are looked into again without a pause, before they are full."""
PACE_SHARE = 0.005
"""Of the time from one message of a station to its next: so long they may wait for those of others, at the pace of a
subscription at least. 5 ms of samples that come each second, 50 ms where ten are gathered."""
SLOWEST_PACE_S = 0.1
"""So long at most they wait for others, however seldom they come. [s]"""
OF_A_KEY = 2
"""Declarations: its messages, and word of which was the last."""
MOST_READY = 100_000
"""Messages that wait for room; beyond them the oldest go, as of publishers that keep nothing."""


class ZenohSubscription:
    """A subscription: its channels, the order of what comes from them, and where it goes.

    Attributes
    ----------
    keys : dict of str, Line
        Where each of its keys was declared.
    """

    def __init__(
        self,
        sessions: Sessions,
        keys: Sequence[str],
        history: int,
        mailbox: Mailbox[Any],
        deliver: Callable[[list[tuple[str, bytes]]], None],
        *,
        recover: bool,
        pace_s: float = PACE_S,
    ) -> None:
        self.pace_s = pace_s
        self.due_s = 0.0
        self.keys: dict[str, Line] = {}
        self.history = history
        self.sequencer = Sequencer(history)
        self.recovers = recover or history > 0
        self._questions = 0
        self._mailbox = mailbox
        self._deliver = deliver
        self._tails: deque[tuple[str, bytes]] = deque()
        self._declared: list[object] = []  # zenoh undeclares what nobody holds
        receivers: list[Receive] = []
        for key in keys:
            self.keys[key] = sessions.first if "*" in key else sessions.with_room(OF_A_KEY)
            session = self.keys[key].session
            room = max(CHANNEL // len(keys), LEAST_CHANNEL)
            subscriber = session.declare_subscriber(key, zenoh.handlers.FifoChannel(room))
            self._declared.append(subscriber)
            receivers.append(subscriber.handler.try_recv)
            if self.recovers:
                self._declared.append(session.declare_subscriber(tail_key(key), at_once(self._handle_tail)))
        self._channels = Channels(receivers, has_rhythm=not any("*" in key for key in keys))

    def _handle_tail(self, sample: zenoh.Sample) -> None:
        if sample.attachment is not None:
            self._tails.append((str(sample.key_expr).rpartition("/")[0], sample.attachment.to_bytes()))

    @property
    def is_crowded(self) -> bool:
        """Whether so much waits that what its publishers keep is better left with them."""
        return self.recovers and (self._mailbox.is_crowded or bool(self.sequencer.ready))

    def await_answers(self, more: int) -> None:
        """Count the questions of this subscription that wait for an answer up or down."""
        self._questions += more
        self._tell_behind()

    def _tell_behind(self) -> None:
        self._mailbox.is_behind = self._questions > 0 or bool(self.sequencer.ready)

    def fetch(self, now_s: float) -> None:
        """Take what has come, in order, and pass it on; where it is crowded only note what to ask for."""
        sequencer, put, count = self.sequencer, zenoh.SampleKind.PUT, 0
        is_crowded = self.is_crowded
        for sample in self._channels.messages(now_s):
            count += 1
            if sample.kind != put:
                continue
            attached = sample.attachment if self.recovers else None
            key, header = str(sample.key_expr), None if attached is None else attached.to_bytes()
            is_crowded = is_crowded or len(sequencer.ready) >= self._mailbox.half
            if is_crowded and header is not None and sequencer.let_go(key, header):
                continue
            sequencer.handle_message(key, header, sample.payload.to_bytes())
        pace_s = max(self.pace_s, min(PACE_SHARE / self._channels.rate_hz, SLOWEST_PACE_S))
        self.due_s = now_s + (pace_s if count < MANY else 0.0)
        while self._tails:
            sequencer.handle_tail(*self._tails.popleft())
        self.pass_on()

    def pass_on(self) -> None:
        """Hand over what is in order; where it can wait, no more than there is room for."""
        ready = self.sequencer.ready
        if not self.recovers or len(ready) > MOST_READY:
            self._deliver(ready)
            self.sequencer.ready = []
            return
        while ready and not self._mailbox.is_crowded:
            self._deliver(ready[: self._mailbox.half])
            del ready[: self._mailbox.half]
        self._tell_behind()

    def handle_page(self, key: str, page: Page, *, is_from_next: bool) -> None:
        """Take an answer; what its publisher does not keep any more is told."""
        self.sequencer.handle_page(key, page, is_from_next=is_from_next)
        self._tell_lost(key)

    def give_up(self, stream: SourceStream) -> None:
        """Go on without what is missing, and say so."""
        self.sequencer.give_up(stream)
        self.pass_on()
        self._tell_lost(stream.key)

    def _tell_lost(self, key: str) -> None:
        lost = self.sequencer.lost - self._mailbox.missed
        if lost > 0:
            logger.warning("%s: %d messages are lost, nobody has them", key, lost)
            self._mailbox.missed = self.sequencer.lost
