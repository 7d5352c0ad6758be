"""Zenoh sessions: a router or a client of one, nothing found by scouting; refusals in one line."""

import contextlib
import json
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal

import zenoh

from wetwell.protocols.bus.zenoh.access import ZenohAccess
from wetwell.protocols.errors import ConfigError, LinkError

RECONNECT = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5}
"""How a client looks for a lost router. Zenoh's own 1 to 4 s would leave a gap of that length."""
MOST_SESSIONS = 10_000
"""Of all processes at a router. Zenoh's own 1,000 are few where one process of 10,000 stations has some 200."""


def open_router_session(endpoint: str, access: ZenohAccess, upstream: Sequence[str]) -> zenoh.Session:
    """Session that listens on an endpoint and looks for the routers above it.

    Raises
    ------
    ConfigError, LinkError
        As `link.open_router`.
    """
    config = _config("router", endpoint, access)
    config.insert_json5("scouting/delay", "0")  # nobody is scouted: do not wait for answers
    if upstream:
        config.insert_json5("connect/endpoints", json.dumps(list(upstream)))
        config.insert_json5("connect/retry", json.dumps(RECONNECT))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise LinkError(f"cannot listen on {endpoint}: {reason(error)}") from error


def open_client_session(endpoint: str, access: ZenohAccess, timeout_s: float) -> zenoh.Session:
    """Session through the router at an endpoint.

    Raises
    ------
    ConfigError, LinkError
        As `link.open_client`.
    """
    config = _config("client", endpoint, access)
    config.insert_json5("connect/timeout_ms", str(max(1, round(timeout_s * 1000))))
    config.insert_json5("connect/retry", json.dumps(RECONNECT))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        doubt = f"it is away or refuses {access.shown}" if access.shown else "wrong credentials look the same"
        raise LinkError(f"no router reached at {endpoint} within {timeout_s:g} s ({doubt})") from error


def _config(mode: Literal["router", "client"], endpoint: str, access: ZenohAccess) -> zenoh.Config:
    config = zenoh.Config()
    settings: dict[str, Any] = {
        "mode": mode,
        "listen/endpoints": [endpoint] if mode == "router" else [],
        "connect/endpoints": [endpoint] if mode == "client" else [],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/unicast/max_sessions": MOST_SESSIONS,
        "transport/shared_memory/enabled": False,  # a process that is killed would leave 16 MB of it behind
    }
    try:
        for name, value in settings.items():
            config.insert_json5(name, json.dumps(value))
    except zenoh.ZError as error:
        raise ConfigError(f"endpoint must be of the form tcp/ADDRESS:PORT, got '{endpoint}'") from error
    for name, value in access.settings(mode, endpoint).items():
        try:
            config.insert_json5(name, json.dumps(value))
        except zenoh.ZError:  # its text may hold a password
            raise ConfigError(f"zenoh refuses the settings of {name}") from None
    return config


@contextlib.contextmanager
def refusal(act: str, key: str) -> Iterator[None]:
    """Turn what Zenoh refuses into a `LinkError` that names the act and the key."""
    try:
        yield
    except zenoh.ZError as error:
        raise LinkError(f"cannot {act} '{key}': {reason(error)}") from error


def reason(error: zenoh.ZError) -> str:
    """What a Zenoh error says, in one line, without places in its source."""
    system = re.search(r"[^:\[]+(?= \(os error \d+\))", str(error))
    if system:
        return system.group().strip().lower()
    return " ".join(re.sub(r" at /\S+\.rs:\d+\.?", "", str(error)).split())


def at_once(handle: Callable[[Any], None]) -> "zenoh.handlers.Callback[Any]":
    """A callback in the thread of the session, for what is rare and takes no time. By default each has a thread."""
    return zenoh.handlers.Callback(handle, indirect=False)
