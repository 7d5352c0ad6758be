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
ALONE = "its death is an outage: start the other member; one that is back stands by when it has heard what it missed"


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
    return list(findings_of(found, settings.ttl_s)) or [
        Finding("leases", "warning", "no role was ever owned", "start a daemon with the same lease.url")
    ]


def findings_of(found: Iterable["Standing"], ttl_s: float) -> Iterator[Finding]:
    """Findings of the roles, whose leases last for `ttl_s`."""
    for standing in found:
        role, lease, others = standing.role, standing.lease, standing.stand_by(ttl_s)
        if not standing.is_owned:
            text = f"role '{role}': nobody owns it; {_listed(others)}"
            yield Finding("leases", "error", text, "look at the logs of its members")
            continue
        since = to_iso(round(lease.since_s) * NS_PER_S)
        text = f"role '{role}': {lease.holder} owns it since {since} (token {lease.token}); {_listed(others)}"
        advice = "" if others else ALONE
        yield Finding("leases", "ok" if others else "warning", text, advice)


def _listed(others: list[str]) -> str:
    return f"{', '.join(others) or 'nobody'} stands by"
