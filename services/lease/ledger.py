"""What the owners of a role have told and kept: messages by key and number, states, lines; each under a token."""

import secrets
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import psycopg

from wetwell.protocols.bus.interface import KeptStream
from wetwell.protocols.bus.publisher_cache import SOURCE_BYTES
from wetwell.protocols.errors import WetwellError
from wetwell.services.lease.database import LeaseDatabase


class LeaseLostError(WetwellError):
    """A role that this process has owned is owned by it no more."""


class Numbered(NamedTuple):
    """A message with its number on its key."""

    key: str
    number: int
    payload: bytes


@dataclass
class Entry:
    """What is kept together, or not at all.

    Attributes
    ----------
    streams : dict
        By key, of those that nobody has begun before, their source.
    messages : list of Numbered
    states : dict
        Content by part.
    lines : list of (int, str)
        Numbered from 0.
    sent : dict
        By key, the number up to which messages have been sent on the bus.
    """

    streams: dict[str, bytes] = field(default_factory=dict)
    messages: list[Numbered] = field(default_factory=list)
    states: dict[str, bytes] = field(default_factory=dict)
    lines: list[tuple[int, str]] = field(default_factory=list)
    sent: dict[str, int] = field(default_factory=dict)

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to keep."""
        return not (self.streams or self.messages or self.states or self.lines or self.sent)


@dataclass(frozen=True)
class Told:
    """Messages of a key: what was sent as far as it is known, and what was kept and perhaps not sent."""

    sent: KeptStream
    unsent: tuple[bytes, ...] = ()


@dataclass(frozen=True)
class Inheritance:
    """What an owner finds of those before it."""

    told: Mapping[str, Told]
    states: Mapping[str, bytes]
    lines: int
    last_line: str | None


class Ledger:
    """The ledger of one role, in PostgreSQL.

    Parameters
    ----------
    database : LeaseDatabase
    role : str
    """

    def __init__(self, database: LeaseDatabase, role: str) -> None:
        self._database = database
        self._role = role

    async def inherit(self, token: int) -> Inheritance:
        """All that owners before have left. Nothing is added to it any more but under this token.

        Raises
        ------
        LinkError
            If the database does not answer in time.
        LeaseLostError
            If another has taken the lease meanwhile.
        """
        return await self._database.call(lambda database: _inherit(database, self._role, token))

    async def enter(self, token: int, entry: Entry, history: Mapping[str, int]) -> None:
        """Keep an entry, under a token; the same one may be entered again where it is not known whether it is in.

        Parameters
        ----------
        history : mapping
            By key, so many sent messages are kept for late joiners.

        Raises
        ------
        LinkError
            If the database does not answer in time.
        LeaseLostError
            If another has taken the lease meanwhile: nothing is kept then.
        """
        await self._database.call(lambda database: _enter(database, self._role, token, entry, history))


def new_stream() -> KeptStream:
    """A stream that nobody has begun."""
    return KeptStream(secrets.token_bytes(SOURCE_BYTES), 0)


def check_token(database: psycopg.Connection[Any], role: str, token: int) -> None:
    """Hold a token against the lease: as the last act of a transaction, so that no other can take it in between.

    Raises
    ------
    LeaseLostError
        If another has taken the lease.
    """
    row = database.execute("SELECT token, holder FROM wetwell.lease WHERE role = %s FOR SHARE", (role,)).fetchone()
    if row is None or row[0] != token:
        owner = "nobody" if row is None else f"{row[1]} with token {row[0]}"
        raise LeaseLostError(f"role '{role}': token {token} is over, the owner is {owner}")


def _inherit(database: psycopg.Connection[Any], role: str, token: int) -> Inheritance:
    check_token(database, role, token)
    payloads: defaultdict[str, dict[int, bytes]] = defaultdict(dict)
    for key, number, payload in database.execute(
        "SELECT key, number, payload FROM wetwell.message WHERE role = %s ORDER BY key, number", (role,)
    ):
        payloads[key][number] = bytes(payload)
    told = {}
    streams = database.execute("SELECT key, source, sent FROM wetwell.stream WHERE role = %s", (role,))
    for key, source, sent in streams:
        kept = payloads[key]
        before = tuple(kept[number] for number in kept if number < sent)
        told[key] = Told(
            KeptStream(bytes(source), sent, before), tuple(kept[number] for number in kept if number >= sent)
        )
    states = database.execute("SELECT part, content FROM wetwell.state WHERE role = %s", (role,)).fetchall()
    last = database.execute(
        "SELECT number, text FROM wetwell.line WHERE role = %s ORDER BY number DESC LIMIT 1", (role,)
    ).fetchone()
    return Inheritance(
        told,
        {part: bytes(content) for part, content in states},
        0 if last is None else last[0] + 1,
        None if last is None else last[1],
    )


def _enter(
    database: psycopg.Connection[Any], role: str, token: int, entry: Entry, history: Mapping[str, int]
) -> None:
    many = database.cursor().executemany
    if entry.streams:
        many(
            "INSERT INTO wetwell.stream VALUES (%s, %s, %s, 0) ON CONFLICT DO NOTHING",
            [(role, key, source) for key, source in sorted(entry.streams.items())],
        )
    if entry.messages:
        many(
            "INSERT INTO wetwell.message VALUES (%s, %s, %s, %s, %s) ON CONFLICT DO NOTHING",
            [(role, key, number, token, payload) for key, number, payload in entry.messages],
        )
    if entry.states:
        many(
            "INSERT INTO wetwell.state VALUES (%s, %s, %s, %s) "
            "ON CONFLICT (role, part) DO UPDATE SET token = excluded.token, content = excluded.content",
            [(role, part, token, content) for part, content in sorted(entry.states.items())],
        )
    if entry.lines:
        many(
            "INSERT INTO wetwell.line VALUES (%s, %s, %s, %s) ON CONFLICT DO NOTHING",
            [(role, number, token, text) for number, text in entry.lines],
        )
    if entry.sent:
        many(
            "UPDATE wetwell.stream SET sent = %s WHERE role = %s AND key = %s",
            [(sent, role, key) for key, sent in sorted(entry.sent.items())],
        )
        many(
            "DELETE FROM wetwell.message WHERE role = %s AND key = %s AND number < %s",
            [(role, key, sent - history.get(key, 1)) for key, sent in sorted(entry.sent.items())],
        )
    check_token(database, role, token)
