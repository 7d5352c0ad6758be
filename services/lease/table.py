"""The table of leases: read, and changed by compare-and-set; and which members stand by."""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import psycopg

from wetwell.services.lease.database import LeaseDatabase
from wetwell.services.lease.tenure import Lease

Change = Callable[[Lease, float], Lease | None]
"""From a lease and the time of the server to the lease that is wanted; None: leave it."""

FORGOTTEN_S = 3600.0
"""Members that were not seen for so long are forgotten. [s]"""


class Member(NamedTuple):
    """A life of a member, and how many seconds ago it was seen to stand by."""

    holder: str
    age_s: float


class Standing(NamedTuple):
    """A role as the table has it: its lease, the time of the server [s since 1970], and its members."""

    role: str
    lease: Lease
    now_s: float
    members: tuple[Member, ...]

    @property
    def is_owned(self) -> bool:
        """Whether a member owns it now."""
        return self.now_s < self.lease.expires_s

    def stand_by(self, ttl_s: float) -> list[str]:
        """Members that could take it over at once, as seen within the time of a lease: with one the pair is whole.

        Examples
        --------
        >>> members = Member("a", 0.0), Member("b", 0.3), Member("c", 2.0)
        >>> Standing("detector/site", Lease("a"), 0.0, members).stand_by(ttl_s=1.5)
        ['b']
        """
        return [one.holder for one in self.members if one.age_s < ttl_s and one.holder != self.lease.holder]


class Leases(Protocol):
    """Leases that are changed by compare-and-set."""

    async def change(self, shown: str | None, change: Change) -> Lease | None:
        """The lease as it was changed; None if it was left, or somebody else changed it meanwhile.

        A member that is `shown` stands by now.

        Raises
        ------
        LinkError
            If the server does not answer.
        """


class LeaseTable:
    """The lease of one role, in PostgreSQL.

    Parameters
    ----------
    database : LeaseDatabase
    role : str
    """

    def __init__(self, database: LeaseDatabase, role: str) -> None:
        self._database = database
        self._role = role

    async def change(self, shown: str | None, change: Change) -> Lease | None:
        """The lease as it was changed; None if it was left, or somebody else changed it meanwhile.

        A member that is `shown` stands by now.

        Raises
        ------
        LinkError
            If the database does not answer in time.
        """
        return await self._database.call(lambda database: _change(database, self._role, shown, change))


def _change(database: psycopg.Connection[Any], role: str, shown: str | None, change: Change) -> Lease | None:
    rows = database.execute(
        "WITH seen AS (INSERT INTO wetwell.member "
        "SELECT %(role)s, %(shown)s, extract(epoch FROM clock_timestamp()) WHERE %(shown)s::text IS NOT NULL "
        "ON CONFLICT (role, holder) DO UPDATE SET seen_s = excluded.seen_s) "
        "SELECT extract(epoch FROM clock_timestamp())::float8, holder, token, since_s, expires_s "
        "FROM (SELECT) AS asked LEFT JOIN wetwell.lease ON role = %(role)s",
        {"role": role, "shown": shown},
    ).fetchall()
    now_s, *kept = rows[0]
    before = Lease() if kept[1] is None else Lease(*kept)
    after = change(before, now_s)
    if after is None:
        return None
    values = {"role": role, "was_token": before.token, "was_s": before.expires_s}
    values |= {"holder": after.holder, "token": after.token, "since_s": after.since_s, "expires_s": after.expires_s}
    changed = database.execute(
        "INSERT INTO wetwell.lease VALUES (%(role)s, %(holder)s, %(token)s, %(since_s)s, %(expires_s)s) "
        "ON CONFLICT (role) DO UPDATE SET holder = excluded.holder, token = excluded.token, "
        "since_s = excluded.since_s, expires_s = excluded.expires_s "
        "WHERE lease.token = %(was_token)s AND lease.expires_s = %(was_s)s",
        values,
    ).rowcount
    if changed and after.token > before.token:
        database.execute("DELETE FROM wetwell.member WHERE role = %s AND seen_s < %s", (role, now_s - FORGOTTEN_S))
    return after if changed else None


def standings(database: psycopg.Connection[Any]) -> list[Standing]:
    """All roles, by name; members that are long gone are left out."""
    leases = database.execute(
        "SELECT role, holder, token, since_s, expires_s, extract(epoch FROM clock_timestamp())::float8 "
        "FROM wetwell.lease ORDER BY 1"
    ).fetchall()
    members = database.execute(
        "SELECT role, holder, extract(epoch FROM clock_timestamp())::float8 - seen_s FROM wetwell.member ORDER BY 2"
    ).fetchall()
    return [
        Standing(
            role,
            Lease(*lease),
            now_s,
            tuple(Member(holder, age_s) for of, holder, age_s in members if of == role and age_s < FORGOTTEN_S),
        )
        for role, *lease, now_s in leases
    ]
