"""What a message costs on a key that was declared to Zenoh, and on one that was not. Prints one JSON object.

    python benchmarks/declared_keys.py --stations 1000

A sender, a receiver and a router in one process: µs of the processor for a message, of the sending thread and of the
whole process. `received` is with a receiver that also watches who lives, as alarms and page do.
"""

import argparse
import json
import os
import time
from collections.abc import Callable
from typing import Any

import zenoh
from site_processes import free_endpoint

from wetwell.protocols.bus.zenoh.access import OPEN
from wetwell.protocols.bus.zenoh.session import open_client_session, open_router_session

PUMPS = 3
DROP = zenoh.CongestionControl.DROP
SETTLE_S = 2.0
ROOM = 1_000_000


def cost_us(send: Callable[[], None], messages: int) -> dict[str, float]:
    """µs of the processor for a message, everything included that comes of it within a while."""
    process_s, thread_s = time.process_time(), time.thread_time()
    send()
    thread_s = time.thread_time() - thread_s
    time.sleep(SETTLE_S)
    process_s = time.process_time() - process_s
    return {"sender": round(1e6 * thread_s / messages, 1), "process": round(1e6 * process_s / messages, 1)}


def measured(stations: int) -> dict[str, Any]:
    """All figures."""
    endpoint = free_endpoint()
    names = [f"s{number:05d}" for number in range(stations)]
    keys = [f"wetwell/{name}/verdict/{pump}" for name in names for pump in range(1, PUMPS + 1)]
    with (
        open_router_session(endpoint, OPEN, ()),
        open_client_session(endpoint, OPEN, 2.0) as sender,
        open_client_session(endpoint, OPEN, 2.0) as receiver,
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
        publishers = [sender.declare_publisher(key, congestion_control=DROP) for key in keys]
        ends = [f"{key}/@tail" for key in keys]

        def publish() -> None:
            for publisher in publishers:
                publisher.put(b"{}")

        def tell_ends() -> None:
            for end in ends:
                sender.put(end, b"", congestion_control=DROP)

        time.sleep(SETTLE_S)
        publish()  # all ways are known afterwards
        figures = {"end_not_declared": cost_us(tell_ends, len(keys))}
        end_publishers = [sender.declare_publisher(end, congestion_control=DROP) for end in ends]

        def tell_declared() -> None:
            for publisher in end_publishers:
                publisher.put(b"")

        tell_declared()
        time.sleep(SETTLE_S)
        figures["end_declared"] = cost_us(tell_declared, len(keys))
        held += [sender.liveliness().declare_token(f"wetwell/{name}/alive/detector") for name in names]
        held.append(
            receiver.liveliness().declare_subscriber(
                "wetwell/*/alive/*", zenoh.handlers.FifoChannel(ROOM), history=True
            )
        )
        time.sleep(SETTLE_S)
        publish()
        figures["received_not_declared"] = cost_us(publish, len(keys))
        held += [receiver.declare_keyexpr(key) for key in keys]
        publish()
        time.sleep(SETTLE_S)
        figures["received_declared"] = cost_us(publish, len(keys))
    return {"stations": stations, "us_a_message": figures}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stations", type=int, default=1000)
    result = measured(parser.parse_args().stations)
    print(json.dumps(result | {"load": os.getloadavg()[0]}, indent=2))


if __name__ == "__main__":
    main()
