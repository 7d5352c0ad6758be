"""What a Zenoh router tells about those that it refuses, as lines of our log.

Zenoh writes its log to standard output and nowhere else. A process that is a router and nothing else has no other use
for that: its standard output becomes a pipe, and what is told there of connections and refusals is told again.
"""

import logging
import os
import re
import threading
from dataclasses import dataclass, field

import zenoh

log = logging.getLogger(__name__)

_FILTER = (
    "zenoh=warn,zenoh_link_tls=debug,zenoh_link_tcp=debug,"
    "zenoh_transport::unicast::establishment::accept=debug,zenoh::net::routing::interceptor=trace"
)
MOST_KEPT = 10_000
"""Most refusals and sessions that are remembered; then all are forgotten, and counted and named anew."""

_LINE = re.compile(r"^\S+\s+(?P<level>[A-Z]+)\s+(?P<thread>.*?ThreadId\(\d+\)) (?P<target>[\w:]+): (?P<said>.*)$")
_COLOUR = re.compile(r"\x1b\[\d*m")
_USER = re.compile(r"^(?P<session>[0-9a-f]+) on .*(?:Username|CertCommonName)\((?P<user>[^)]*)\)")
_DENIED = re.compile(
    r"^(?:Using cached result: )?(?P<session>[0-9a-f]+) .*?"
    r"is unauthorized to (?P<act>.+) \(ingress\) on (?P<key>\S+)$"
)
_REFUSALS = {
    "Invalid password": "wrong password",
    "Invalid user": "no such user",
    "Expected extension": "no user and password",
    "peer sent no certificates": "no certificate",
    "invalid peer certificate": "a certificate that is not of zenoh.tls.root_ca, or not valid now",
    "received fatal alert": "it does not trust this router's certificate",
}
_ENDS_THE_START = "Unable to open listener"
"""Told by the error with which the process ends, whose line must be the last."""
_ACCEPTED = re.compile(r"Accepted (?P<kind>TCP|TLS) connection on [^ ]+: (?P<peer>\S+:\d+)")


def relay_router_log() -> None:
    """Tell refusals in our log from now on, once and for all; standard output of this process is gone then."""
    reading, writing = os.pipe()
    os.dup2(writing, 1)
    os.close(writing)
    zenoh.init_log_from_env_or(_FILTER)
    threading.Thread(target=_relay, args=(reading,), name="zenoh-log", daemon=True).start()


def _relay(descriptor: int) -> None:
    reader = LogReader()
    with open(descriptor, encoding="utf-8", errors="replace") as lines:
        for line in lines:
            told = reader.told(line)
            if told is not None:
                log.log(*told)


@dataclass
class LogReader:
    """Picks what matters from the lines of Zenoh's log.

    The access control also weighs keys that it will need; only a line that `Msg intercepted!` follows in the same
    thread is about a message that was dropped. Of the same refusal the 1st, 10th, 100th ... is told.

    Examples
    --------
    >>> LogReader().told("2026-01-01T00:00:00Z DEBUG acc-0 ThreadId(05) zenoh_transport::x: Invalid user.")
    (30, 'a client is refused: no such user (1 time)')
    """

    _users: dict[str, str] = field(default_factory=dict)
    _denied: dict[str, str] = field(default_factory=dict)
    _counts: dict[str, int] = field(default_factory=dict)

    def told(self, line: str) -> tuple[int, str] | None:
        """Level and text of what a line says; None if it is not worth telling."""
        match = _LINE.match(_COLOUR.sub("", line).rstrip())
        if match is None:
            return None
        said, thread = match["said"], match["thread"]
        if "::interceptor" in match["target"]:
            return self._access(thread, said)
        for sign, reason in _REFUSALS.items():
            if sign in said:
                return self._count(f"a client is refused: {reason}")
        accepted = _ACCEPTED.search(said)
        if accepted is not None:
            return logging.INFO, f"connection from {accepted['peer']}"
        if match["level"] in {"WARN", "ERROR"} and not said.startswith(_ENDS_THE_START):
            return logging.WARNING, said
        return None

    def _access(self, thread: str, said: str) -> tuple[int, str] | None:
        if said == "Msg intercepted!":
            denied = self._denied.pop(thread, None)
            return None if denied is None else self._count(denied)
        user, denial = _USER.match(said), _DENIED.match(said)
        if user is not None:
            self._users[user["session"]] = user["user"]
        if denial is not None:
            name, key = self._users.get(denial["session"], denial["session"]), denial["key"].partition("/@tail")[0]
            act = denial["act"].lower().replace("liveliness token", "announce itself")
            self._denied[thread] = f"'{name}' may not {act} on {key}: dropped"
        elif " is authorized to " in said:
            self._denied.pop(thread, None)
        return None

    def _count(self, text: str) -> tuple[int, str] | None:
        if len(self._counts) + len(self._users) > MOST_KEPT:  # sessions and keys are the sender's choice
            self._counts.clear()
            self._users.clear()
        count = self._counts[text] = self._counts.get(text, 0) + 1
        is_told = str(count).strip("0") == "1"
        return (logging.WARNING, f"{text} ({count} {'time' if count == 1 else 'times'})") if is_told else None
