"""A bus over a network that delays, cuts, doubles and forgets, in virtual time.

It keeps what the bus over Zenoh keeps: the messages of one publisher come in order, what was lost on the way comes
from the publisher's cache as long as that has it, a late joiner gets the last messages, a cache dies with its
process.
"""

import asyncio
import contextvars
import functools
import random
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from memory_bus import matches as any_matches

from wetwell.protocols.bus.interface import PACE_S, Keyed, Presence, Request
from wetwell.protocols.bus.mailbox import Mailbox

matches = functools.cache(any_matches)
SHORT_S, LONG_S = 0.002, 1.0
"""Usual delay of a message; delay of one that was lost and had to be asked for."""
ASK_AGAIN_S = 10.0
"""So often what is kept is asked for where nobody can say when the link comes back."""
_OUTSIDE = contextvars.Context()
"""What the network does is done by no process: none that stands or dies holds it up."""


@dataclass(frozen=True)
class Sent:
    """A message that a process has given to its bus."""

    payload: bytes
    at_s: float
    bus: "SimulatedBus"


@dataclass
class Network:
    """Who is connected; `loss` is the share of messages that come late because they were lost once.

    Attributes
    ----------
    sent : dict
        All that was given to a bus on some keys, whether or not it got out.
    places : dict
        Key and place there of each time that something was given, by what it was.
    """

    dice: random.Random
    loss: float = 0.01
    doubles: float = 0.01
    buses: "list[SimulatedBus]" = field(default_factory=list)
    sent: dict[str, list[Sent]] = field(default_factory=dict)
    places: dict[bytes, list[tuple[str, int]]] = field(default_factory=dict)

    def join(self, name: str) -> "SimulatedBus":
        """Connection of a process."""
        bus = SimulatedBus(self, name)
        self.buses.append(bus)
        return bus

    def note(self, key: str, sent: Sent) -> None:
        """Remember what was given to a bus."""
        all_sent = self.sent.setdefault(key, [])
        self.places.setdefault(sent.payload, []).append((key, len(all_sent)))
        all_sent.append(sent)


class Cache:
    """Last messages of one publisher; they are numbered from 0, `end` is the number of the next."""

    def __init__(self, history: int) -> None:
        self.kept: deque[bytes] = deque(maxlen=history)
        self.end = 0

    def add(self, payload: bytes) -> int:
        """Keep a message; its number."""
        self.kept.append(payload)
        self.end += 1
        return self.end - 1

    def last(self, history: int) -> Iterator[tuple[int, bytes]]:
        """The last so many with their numbers, oldest first."""
        begin = self.end - len(self.kept)
        for number, payload in enumerate(self.kept, begin):
            if number >= self.end - history:
                yield number, payload


class SimulatedBus:
    """A `Bus` of one process. `kill` is the end of the process, `cut` the end of its link for a while."""

    def __init__(self, network: Network, name: str) -> None:
        self.name = name
        self.is_alive = True
        self.died_s = float("inf")
        self.mute_s = self.deaf_s = 0.0
        """Until then nothing leaves it, or reaches it."""
        self.caches: dict[str, Cache] = {}
        self._network = network
        self._subscriptions: list[Subscription] = []
        self._answerers: list[tuple[str, Mailbox[Request]]] = []
        self._announced: set[str] = set()
        self._watchers: list[tuple[str, Mailbox[Presence]]] = []

    @property
    def is_connected(self) -> bool:
        """Whether it hears others now."""
        return self.is_alive and self.deaf_s <= _now_s()

    def kill(self) -> None:
        """Nothing leaves or reaches the process any more, and its caches are gone."""
        if not self.is_alive:
            return
        self.is_alive = False
        self.died_s = _now_s()
        self._network.buses.remove(self)
        for key in sorted(self._announced):
            for bus in self._network.buses:
                bus.tell(Presence(key, is_alive=False))

    def cut(self, seconds: float, *, is_mute: bool = True, is_deaf: bool = True) -> None:
        """Let nothing through for a while, or in one direction only; the caches bring it afterwards, if they can."""
        until_s = _now_s() + seconds
        self.mute_s = max(self.mute_s, until_s) if is_mute else self.mute_s
        self.deaf_s = max(self.deaf_s, until_s) if is_deaf else self.deaf_s

    def publisher(self, key: str, *, history: int = 1) -> "SimulatedPublisher":
        """Publisher with a cache that lives as long as the process."""
        self.caches.setdefault(key, Cache(history))
        return SimulatedPublisher(self, key)

    def put(self, key: str, payload: bytes) -> None:
        """Send a message to all who listen."""
        if not self.is_alive:
            return
        self._network.note(key, Sent(payload, _now_s(), self))
        number = self.caches[key].add(payload)
        for bus in self._network.buses:
            for subscription in bus._subscriptions:
                if matches(subscription.expression, key):
                    subscription.send(self, key, number, payload)

    def subscribe(
        self,
        key: str,
        *,
        history: int = 0,
        capacity: int = 10_000,
        recover: bool = True,  # noqa: ARG002 -- as a `Bus`
        pace_s: float = PACE_S,  # noqa: ARG002 - what comes is there at once
    ) -> Mailbox[bytes]:
        """Messages of a key expression, beginning with the last ones that living publishers keep.

        No publisher waits for room, as those over Zenoh do: where too many come at once the oldest are lost.
        """
        mailbox: Mailbox[bytes] = Mailbox(capacity)
        self._begin(Subscription(key, mailbox, self), history)
        return mailbox

    def _begin(self, subscription: "Subscription", history: int) -> None:
        for bus in self._network.buses:
            for kept_key, cache in sorted(bus.caches.items()):
                if matches(subscription.expression, kept_key):
                    for number, payload in list(cache.last(history)):
                        subscription.send(bus, kept_key, number, payload, is_kept=True)
        self._subscriptions.append(subscription)

    def collect(
        self,
        keys: Sequence[str],
        *,
        history: int = 0,
        capacity: int = 10_000,
        recover: bool = True,  # noqa: ARG002 -- as a `Bus`
        pace_s: float = PACE_S,  # noqa: ARG002 - what comes is there at once
    ) -> Mailbox[Keyed]:
        """Messages of many keys, with their keys."""
        mailbox: Mailbox[Keyed] = Mailbox(capacity)
        for key in keys:
            self._begin(Subscription(key, mailbox, self, is_keyed=True), history)
        return mailbox

    def answer(self, key: str) -> Mailbox[Request]:
        """Questions on a key."""
        mailbox: Mailbox[Request] = Mailbox(1_000)
        self._answerers.append((key, mailbox))
        return mailbox

    async def ask(self, key: str, payload: bytes = b"", *, timeout_s: float = 5.0) -> list[bytes]:
        """Answers that come in time, and the last messages of publishers."""
        answers: list[bytes] = []
        waiting: list[SimulatedRequest] = []
        for bus in list(self._network.buses):
            if not can_pass(self, bus):
                continue
            if can_pass(bus, self):
                kept = sorted((name, cache) for name, cache in bus.caches.items() if cache.end and matches(key, name))
                answers += [cache.kept[-1] for _, cache in kept]
            for expression, mailbox in bus._answerers:
                if matches(expression, key) or matches(key, expression):
                    request = SimulatedRequest(key, payload, self, bus)
                    waiting.append(request)
                    _call_at(_now_s() + self.delay_s(), request.arrive, mailbox)
        if waiting:
            done, late = await asyncio.wait([request.answered for request in waiting], timeout=timeout_s)
            answers += [request.answered.result() for request in waiting if request.answered in done]
            for future in late:
                future.cancel()
        return answers

    def delay_s(self) -> float:
        """How long a message takes that is not lost on the way."""
        return self._network.dice.uniform(0.5, 1.5) * SHORT_S

    def announce(self, key: str) -> None:
        """Show that a service lives."""
        if self.is_alive and key not in self._announced:
            self._announced.add(key)
            for bus in self._network.buses:
                bus.tell(Presence(key, is_alive=True))

    def watch(self, key: str) -> Mailbox[Presence]:
        """Services that live, then each change."""
        mailbox: Mailbox[Presence] = Mailbox(10_000)
        self._watchers.append((key, mailbox))
        for bus in self._network.buses:
            for announced in sorted(bus._announced):
                if matches(key, announced):
                    mailbox.put(Presence(announced, is_alive=True))
        return mailbox

    def tell(self, presence: Presence) -> None:
        """Pass a change of presence on."""
        for expression, mailbox in self._watchers:
            if matches(expression, presence.key):
                mailbox.put(presence)


class SimulatedPublisher:
    """Publisher on one key of a `SimulatedBus`."""

    def __init__(self, bus: SimulatedBus, key: str) -> None:
        self._bus = bus
        self._key = key

    def put(self, payload: bytes, weight: int = 1) -> None:  # noqa: ARG002 -- as a `Publisher`
        """Send a message."""
        self._bus.put(self._key, payload)


@dataclass
class Stream:
    """Messages of one publisher on their way to one subscription, in their order."""

    sender: SimulatedBus
    key: str
    on_the_way: deque[tuple[float, int, bytes, bool]] = field(default_factory=deque)
    """When it is due, its number, the message, and whether it comes from the cache."""
    is_begun: bool = False


class Subscription:
    """What one process wants to hear; the messages of one publisher come in order."""

    def __init__(self, expression: str, mailbox: Mailbox, owner: SimulatedBus, *, is_keyed: bool = False) -> None:
        self.expression = expression
        self._is_keyed = is_keyed
        self.mailbox = mailbox
        self._owner = owner
        self._streams: dict[tuple[SimulatedBus, str], Stream] = {}

    def send(self, sender: SimulatedBus, key: str, number: int, payload: bytes, *, is_kept: bool = False) -> None:
        """Deliver a message after its delay; one that is lost on the way, or kept, comes from the cache."""
        dice = self._owner._network.dice
        is_kept = is_kept or dice.random() < self._owner._network.loss or not can_pass(sender, self._owner)
        delay_s = dice.uniform(0.5, 1.5) * (LONG_S if is_kept else SHORT_S)
        stream = self._streams.setdefault((sender, key), Stream(sender, key))
        due_s = _now_s() + delay_s
        if stream.on_the_way:
            due_s = max(due_s, stream.on_the_way[-1][0])
        stream.on_the_way.append((due_s, number, payload, is_kept))
        if len(stream.on_the_way) == 1:
            self._wait_for_next(stream)

    def _wait_for_next(self, stream: Stream) -> None:
        _call_at(max(stream.on_the_way[0][0], _now_s()), self._deliver, stream)

    def _deliver(self, stream: Stream) -> None:
        """Deliver all that is due: what a cache keeps comes in one go, as the answer to one question."""
        sender, owner = stream.sender, self._owner
        while owner.is_alive and stream.on_the_way and stream.on_the_way[0][0] <= _now_s():
            if stream.on_the_way[0][-1] and sender.is_alive and not can_pass(sender, owner):
                healed_s = max(sender.mute_s, owner.deaf_s)
                _call_at(min(healed_s, _now_s() + ASK_AGAIN_S) + LONG_S, self._deliver, stream)
                return
            self._take(stream)
        if owner.is_alive and stream.on_the_way:
            self._wait_for_next(stream)

    def _take(self, stream: Stream) -> None:
        sender, owner = stream.sender, self._owner
        _, number, payload, is_kept = stream.on_the_way.popleft()
        cache = sender.caches[stream.key]
        if is_kept and (not sender.is_alive or number < cache.end - len(cache.kept)):
            self.mailbox.missed += stream.is_begun
        else:
            stream.is_begun = True
            message = (stream.key, payload) if self._is_keyed else payload
            self.mailbox.put(message)
            if owner._network.dice.random() < owner._network.doubles:
                self.mailbox.put(message)


class SimulatedRequest:
    """Question on the way."""

    def __init__(self, key: str, payload: bytes, asker: SimulatedBus, answerer: SimulatedBus) -> None:
        self.key = key
        self.payload = payload
        self.answered: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()
        self._asker = asker
        self._answerer = answerer

    def arrive(self, mailbox: Mailbox[Request]) -> None:
        """Reach who answers, if there is still a way."""
        if self._answerer.is_alive and can_pass(self._asker, self._answerer):
            mailbox.put(self)

    def reply(self, payload: bytes) -> None:
        """Answer it, after the way back."""
        _call_at(_now_s() + self._asker.delay_s(), self._come_back, payload)

    def _come_back(self, payload: bytes) -> None:
        if not self.answered.done() and self._asker.is_alive and can_pass(self._answerer, self._asker):
            self.answered.set_result(payload)


def can_pass(sender: SimulatedBus, receiver: SimulatedBus) -> bool:
    """Whether what one sends now reaches the other."""
    return max(sender.mute_s, receiver.deaf_s) <= _now_s()


def _call_at(when_s: float, callback: object, *args: object) -> None:
    """A timer of the network, of no process."""
    asyncio.get_running_loop().call_at(when_s, callback, *args, context=_OUTSIDE)  # type: ignore[arg-type]


def _now_s() -> float:
    return asyncio.get_running_loop().time()
