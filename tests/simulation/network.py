"""A bus over a network that delays, cuts, doubles and forgets, in virtual time.

It keeps what the bus over Zenoh keeps: the messages of one publisher come in order, what was
lost on the way comes from the publisher's cache, a late joiner gets the last messages, a cache dies with its process.
"""

import asyncio
import functools
import random
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from memory_bus import matches as any_matches

from wetwell.protocols.bus.interface import Keyed, Presence, Request
from wetwell.protocols.bus.mailbox import Mailbox

matches = functools.cache(any_matches)
SHORT_S, LONG_S = 0.002, 1.0
"""Usual delay of a message; delay of one that was lost and had to be asked for."""


@dataclass
class Network:
    """Who is connected; `loss` is the share of messages that come late because they were lost once."""

    dice: random.Random
    loss: float = 0.01
    doubles: float = 0.01
    buses: "list[SimulatedBus]" = field(default_factory=list)

    def join(self, name: str) -> "SimulatedBus":
        """Connection of a process."""
        bus = SimulatedBus(self, name)
        self.buses.append(bus)
        return bus

    def delay_s(self) -> float:
        """How long the next message takes."""
        is_lost = self.dice.random() < self.loss
        return self.dice.uniform(0.5, 1.5) * (LONG_S if is_lost else SHORT_S)


class SimulatedBus:
    """A `Bus` of one process. `kill` is the end of the process, `cut` the end of its link for a while."""

    def __init__(self, network: Network, name: str) -> None:
        self.name = name
        self.is_alive = True
        self._network = network
        self._caches: dict[str, deque[bytes]] = {}
        self._subscriptions: list[Subscription] = []
        self._answerers: list[tuple[str, Mailbox[Request]]] = []
        self._announced: set[str] = set()
        self._watchers: list[tuple[str, Mailbox[Presence]]] = []
        self._healed_s = 0.0

    @property
    def is_connected(self) -> bool:
        """Whether messages can reach others now."""
        return self.is_alive and self._healed_s <= _now_s()

    def kill(self) -> None:
        """Nothing leaves or reaches the process any more, and its caches are gone."""
        self.is_alive = False
        self._network.buses.remove(self)
        for key in sorted(self._announced):
            for bus in self._network.buses:
                bus.tell(Presence(key, is_alive=False))

    def cut(self, seconds: float) -> None:
        """Let nothing through for a while; the caches bring it afterwards, as far as they reach."""
        self._healed_s = max(self._healed_s, _now_s() + seconds)

    def publisher(self, key: str, *, history: int = 1) -> "SimulatedPublisher":
        """Publisher with a cache that lives as long as the process."""
        self._caches.setdefault(key, deque(maxlen=history))
        return SimulatedPublisher(self, key)

    def put(self, key: str, payload: bytes) -> None:
        """Send a message to all who listen."""
        if not self.is_alive:
            return
        self._caches[key].append(payload)
        for bus in self._network.buses:
            for subscription in bus._subscriptions:
                if matches(subscription.expression, key):
                    subscription.send(self, key, payload, max(self._healed_s, bus._healed_s))

    def subscribe(self, key: str, *, history: int = 0, capacity: int = 10_000) -> Mailbox[bytes]:
        """Messages of a key expression, beginning with the last ones that living publishers keep."""
        mailbox: Mailbox[bytes] = Mailbox(capacity)
        self._begin(Subscription(key, mailbox, self), history)
        return mailbox

    def _begin(self, subscription: "Subscription", history: int) -> None:
        for bus in self._network.buses:
            for kept_key, cache in sorted(bus._caches.items()):
                if matches(subscription.expression, kept_key):
                    for payload in list(cache)[max(0, len(cache) - history) :]:
                        subscription.send(bus, kept_key, payload, max(self._healed_s, bus._healed_s))
        self._subscriptions.append(subscription)

    def collect(self, keys: Sequence[str], *, history: int = 0, capacity: int = 10_000) -> Mailbox[Keyed]:
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
        end_s = _now_s() + timeout_s
        answers: list[bytes] = []
        waiting: list[SimulatedRequest] = []
        for bus in list(self._network.buses):
            if max(self._healed_s, bus._healed_s) > end_s:
                continue
            answers += [cache[-1] for kept, cache in sorted(bus._caches.items()) if cache and matches(key, kept)]
            for expression, mailbox in bus._answerers:
                if matches(expression, key) or matches(key, expression):
                    request = SimulatedRequest(key, payload, self._network.delay_s())
                    waiting.append(request)
                    asyncio.get_running_loop().call_later(self._network.delay_s(), _put, bus, mailbox, request)
        if waiting:
            done, late = await asyncio.wait([request.answered for request in waiting], timeout=timeout_s)
            answers += [request.answered.result() for request in waiting if request.answered in done]
            for future in late:
                future.cancel()
        return answers

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

    def put(self, payload: bytes) -> None:
        """Send a message."""
        self._bus.put(self._key, payload)


class Subscription:
    """What one process wants to hear; the messages of one publisher come in order."""

    def __init__(self, expression: str, mailbox: Mailbox, owner: SimulatedBus, *, is_keyed: bool = False) -> None:
        self.expression = expression
        self._is_keyed = is_keyed
        self.mailbox = mailbox
        self._owner = owner
        self._last_s: dict[tuple[SimulatedBus, str], float] = {}

    def send(self, sender: SimulatedBus, key: str, payload: bytes, not_before_s: float) -> None:
        """Deliver a message after its delay, and now and then once more."""
        network = self._owner._network
        due_s = max(_now_s(), not_before_s) + network.delay_s()
        due_s = max(due_s, self._last_s.get((sender, key), 0.0) + 1e-6)  # timers of one moment have no order
        self._last_s[sender, key] = due_s
        loop = asyncio.get_running_loop()
        message = (key, payload) if self._is_keyed else payload
        loop.call_at(due_s, _put, self._owner, self.mailbox, message)
        if network.dice.random() < network.doubles:
            loop.call_at(due_s, _put, self._owner, self.mailbox, message)


class SimulatedRequest:
    """Question on the way."""

    def __init__(self, key: str, payload: bytes, back_s: float) -> None:
        self.key = key
        self.payload = payload
        self.answered: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()
        self._back_s = back_s

    def reply(self, payload: bytes) -> None:
        """Answer it, after the way back."""
        asyncio.get_running_loop().call_later(self._back_s, self._arrive, payload)

    def _arrive(self, payload: bytes) -> None:
        if not self.answered.done():
            self.answered.set_result(payload)


def _put(owner: SimulatedBus, mailbox: Mailbox, message: object) -> None:
    if owner.is_alive:
        mailbox.put(message)


def _now_s() -> float:
    return asyncio.get_running_loop().time()
