"""One subscription of a Zenoh bus."""

import logging
from collections import deque
from collections.abc import Callable, Sequence

import zenoh

from wetwell.protocols.bus.keys import tail_key
from wetwell.protocols.bus.publisher_cache import Page
from wetwell.protocols.bus.sequencer import Sequencer, SourceStream
from wetwell.protocols.bus.zenoh.publisher import at_once

logger = logging.getLogger(__name__)

CHANNEL = 100_000
"""Messages that Zenoh's threads may put into a channel while Python is busy; then they wait, and routers drop."""
TURN = 5_000
"""Messages that are fetched from one channel before the others have their turn."""


class ZenohSubscription:
    """A subscription: its channels, the order of what comes from them, and where it goes."""

    def __init__(
        self,
        session: zenoh.Session,
        keys: Sequence[str],
        history: int,
        deliver: Callable[[list[tuple[str, bytes]]], None],
        *,
        recover: bool,
    ) -> None:
        self.keys = keys
        self.history = history
        self.sequencer = Sequencer(history)
        self.recovers = recover or history > 0
        self._deliver = deliver
        self._tails: deque[tuple[str, bytes]] = deque()
        self._declared: list[object] = []  # zenoh undeclares what nobody holds
        self._channels: list[Callable[[], zenoh.Sample | None]] = []
        self._told = 0
        for key in keys:
            subscriber = session.declare_subscriber(key, zenoh.handlers.FifoChannel(CHANNEL))
            self._declared.append(subscriber)
            self._channels.append(subscriber.handler.try_recv)
            if self.recovers:
                self._declared.append(session.declare_subscriber(tail_key(key), at_once(self._handle_tail)))

    def _handle_tail(self, sample: zenoh.Sample) -> None:
        if sample.attachment is not None:
            self._tails.append((str(sample.key_expr).rpartition("/")[0], sample.attachment.to_bytes()))

    def fetch(self) -> None:
        """Take what has come, in order, and pass it on."""
        sequencer, put = self.sequencer, zenoh.SampleKind.PUT
        for try_recv in self._channels:
            for _ in range(TURN):
                sample = try_recv()
                if sample is None:
                    break
                if sample.kind != put:
                    continue
                header = sample.attachment if self.recovers else None
                sequencer.handle_message(
                    str(sample.key_expr), None if header is None else header.to_bytes(), sample.payload.to_bytes()
                )
        while self._tails:
            sequencer.handle_tail(*self._tails.popleft())
        self.pass_on()

    def pass_on(self) -> None:
        """Hand over what is in order."""
        if self.sequencer.ready:
            ready, self.sequencer.ready = self.sequencer.ready, []
            self._deliver(ready)

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
        if self.sequencer.lost > self._told:
            logger.warning("%s: %d messages are lost, nobody has them", key, self.sequencer.lost - self._told)
            self._told = self.sequencer.lost
