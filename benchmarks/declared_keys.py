"""What declarations to Zenoh cost, and messages on keys that were declared and not. Prints one JSON object.

    python benchmarks/declared_keys.py --stations 1000

A sender, a receiver and a router in one process. `declaring_s`: seconds of the processor until all of them know what
a detector declares of its stations, with its publishers as keys or as publishers of Zenoh, in one session or in as
many as the bus takes. `us_a_message`: µs of the processor for a message, of the sending thread and of the whole
process: on a key as text, on one that the sender declared, and on one where it also says that it lives, so that the
router knows it; then where the receiver watches who lives in a session of its own, and where in the same.
"""

import argparse
import contextlib
import json
import os
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import zenoh
from site_processes import free_endpoint

from wetwell.protocols.bus.zenoh.access import OPEN
from wetwell.protocols.bus.zenoh.session import open_client_session, open_router_session
from wetwell.protocols.bus.zenoh.sessions import Line, Sessions

PUMPS = 3
DROP = zenoh.CongestionControl.DROP
SETTLE_S = 2.0
ROOM = 1_000_000
HEARD = ("sample", "samples", "sample/@tail", "samples/@tail")
PATIENCE_S = 600.0
ROUNDS = 20
"""Of the messages, so that the idle time at their end does not count."""


def process_s(act: Callable[[], None]) -> float:
    """Seconds of the processor of the whole process, until it has been idle for a while."""
    begun_s = time.process_time()
    act()
    idle_s, deadline_s = 0.0, time.monotonic() + PATIENCE_S
    while idle_s < SETTLE_S and time.monotonic() < deadline_s:
        before_s = time.process_time()
        time.sleep(0.2)
        idle_s = idle_s + 0.2 if time.process_time() - before_s < 0.02 else 0.0
    return time.process_time() - begun_s


def cost_us(send: Callable[[], None], messages: int) -> dict[str, float]:
    """µs of the processor for a message, everything included that comes of it within a while."""
    thread_s = 0.0

    def timed() -> None:
        nonlocal thread_s
        before_s = time.thread_time()
        send()
        thread_s = time.thread_time() - before_s

    whole_s = process_s(timed)
    return {"sender": round(1e6 * thread_s / messages, 1), "process": round(1e6 * whole_s / messages, 1)}


@contextlib.contextmanager
def detector_like(
    endpoint: str, names: list[str], *, has_publishers: bool, has_one_session: bool
) -> Iterator[Callable[[], None]]:
    """What declares all that a detector does for its stations."""
    further = partial(open_client_session, endpoint, OPEN, 2.0)
    first = further()
    sessions = Sessions(first, None if has_one_session else further)
    held: list[object] = []

    def declare_publishers(line: Line, key: str) -> None:
        declare: Any = line.session.declare_publisher if has_publishers else line.numbered
        held.extend([declare(key), line.session.declare_queryable(key, zenoh.handlers.FifoChannel(8))])

    def declare() -> None:
        for name in names:
            for heard in HEARD:
                session = sessions.with_room(1).session
                held.append(session.declare_subscriber(f"wetwell/{name}/{heard}", zenoh.handlers.FifoChannel(64)))
            for pump in range(1, PUMPS + 1):
                declare_publishers(sessions.with_room(3), f"wetwell/{name}/verdict/{pump}")
            session = sessions.with_room(1).session
            held.append(session.liveliness().declare_token(f"wetwell/{name}/alive/detector"))

    try:
        yield declare
    finally:
        held.clear()
        sessions.close()


def declaring_s(stations: int, **manner: bool) -> float:
    """Seconds of the processor for the declarations of stations."""
    endpoint = free_endpoint()
    names = [f"s{number:05d}" for number in range(stations)]
    with open_router_session(endpoint, OPEN, ()), detector_like(endpoint, names, **manner) as declare:
        return round(process_s(declare), 2)


def messages_us(stations: int) -> dict[str, Any]:
    """The costs of a message."""
    endpoint = free_endpoint()
    names = [f"s{number:05d}" for number in range(stations)]
    keys = [f"wetwell/{name}/verdict/{pump}" for name in names for pump in range(1, PUMPS + 1)]
    figures: dict[str, Any] = {}
    with (
        open_router_session(endpoint, OPEN, ()),
        open_client_session(endpoint, OPEN, 2.0) as sender,
        open_client_session(endpoint, OPEN, 2.0) as receiver,
        open_client_session(endpoint, OPEN, 2.0) as apart,
    ):
        held: list[object] = [
            receiver.declare_subscriber(f"wetwell/*/{key}", zenoh.handlers.FifoChannel(ROOM))
            for key in ("sample", "samples", "verdict/*", "verdict/*/@tail")
        ]
        held += [
            sender.declare_subscriber(f"wetwell/{name}/{key}", zenoh.handlers.FifoChannel(64))
            for name in names
            for key in ("sample", "samples")
        ]

        def send(sent: list[Any]) -> None:
            for _ in range(ROUNDS):
                for key in sent:
                    sender.put(key, b"{}", congestion_control=DROP)

        messages = ROUNDS * len(keys)
        figures["as_text"] = cost_us(partial(send, keys), messages)
        numbered: list[Any] = [sender.declare_keyexpr(key) for key in keys]
        process_s(partial(send, numbered))  # all ways are known afterwards
        figures["declared"] = cost_us(partial(send, numbered), messages)
        held += [sender.liveliness().declare_token(key) for key in keys]
        process_s(partial(send, numbered))
        figures["known_to_the_router"] = cost_us(partial(send, numbered), messages)
        held += [sender.liveliness().declare_token(f"wetwell/{name}/alive/detector") for name in names]
        for place, session in (("watched_apart", apart), ("watched_beside", receiver)):
            watching = session.liveliness().declare_subscriber(
                "wetwell/*/alive/*", zenoh.handlers.FifoChannel(ROOM), history=True
            )
            process_s(partial(send, numbered))
            figures[place] = cost_us(partial(send, numbered), messages)
            watching.undeclare()
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stations", type=int, default=1000)
    stations = parser.parse_args().stations
    print(
        json.dumps(
            {
                "stations": stations,
                "declaring_s": {
                    "publishers_in_one_session": declaring_s(stations, has_publishers=True, has_one_session=True),
                    "publishers_in_many": declaring_s(stations, has_publishers=True, has_one_session=False),
                    "keys_in_one_session": declaring_s(stations, has_publishers=False, has_one_session=True),
                    "keys_in_many": declaring_s(stations, has_publishers=False, has_one_session=False),
                },
                "us_a_message": messages_us(stations),
                "load": os.getloadavg()[0],
            },
            indent=2,
        )
    )


if __name__ == "__main__":
    main()
