"""Who owns the roles of a site that runs its daemons in pairs, as their database has it."""

import contextlib
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from wetwell.protocols.errors import LinkError
from wetwell.protocols.timestamps import NS_PER_S, to_iso
from wetwell.services.doctor.finding import Finding
from wetwell.services.runtime.settings import LeaseSettings

if TYPE_CHECKING:
    from wetwell.services.lease.table import Standing

LEASES_S = 5.0
"""So long the database may take to answer. [s]"""
SEEN_S = 10.0
"""A member that was not seen for so long does not stand by. [s]"""


async def lease_findings(settings: LeaseSettings) -> list[Finding]:
    """Each role with its owner, since when it is that, and who stands by; nothing without a database of leases."""
    if settings.url is None:
        return []
    from wetwell.services.lease.database import LeaseDatabase  # noqa: PLC0415 - most sites have no database
    from wetwell.services.lease.table import standings  # noqa: PLC0415

    with contextlib.closing(LeaseDatabase(settings.url.get_secret_value(), settings.password_file, LEASES_S)) as kept:
        try:
            found = await kept.call(standings)
        except LinkError as error:
            return [Finding("leases", "error", str(error), "nobody can own a role: bring the database back")]
    return list(findings_of(found)) or [
        Finding("leases", "warning", "no role was ever owned", "start a daemon with the same lease.url")
    ]


def findings_of(found: Iterable["Standing"]) -> Iterator[Finding]:
    """Findings of the roles."""
    for role, lease, now_s, members in found:
        others = [one.holder for one in members if one.age_s < SEEN_S and one.holder != lease.holder]
        if now_s >= lease.expires_s:
            text = f"role '{role}': nobody owns it; {_listed(others)}"
            yield Finding("leases", "error", text, "look at the logs of its members")
            continue
        since = to_iso(round(lease.since_s) * NS_PER_S)
        text = f"role '{role}': {lease.holder} owns it since {since} (token {lease.token}); {_listed(others)}"
        advice = "" if others else "its death is an outage: start the other member"
        yield Finding("leases", "ok" if others else "warning", text, advice)


def _listed(others: list[str]) -> str:
    return f"{', '.join(others) or 'nobody'} stands by"
