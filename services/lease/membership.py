"""A member's part in a role: stands by, takes the lease, acts as the owner until it is lost."""

import asyncio
import logging
import secrets
import socket
import time
from collections.abc import Callable, Coroutine
from typing import Any

from wetwell.protocols.bus.interface import Bus
from wetwell.protocols.bus.keys import SITE
from wetwell.protocols.errors import ConfigError, LinkError
from wetwell.services.lease.database import LeaseDatabase
from wetwell.services.lease.ledger import Inheritance, LeaseLostError, Ledger, check_token
from wetwell.services.lease.outbox import TRY_AGAIN_S, Outbox
from wetwell.services.lease.table import Change, Leases, LeaseTable
from wetwell.services.lease.tenure import Lease, Tenure
from wetwell.services.runtime.health.board import BOARD
from wetwell.services.runtime.postgres import Fence, unfrozen
from wetwell.services.runtime.settings import LeaseSettings

log = logging.getLogger(__name__)

RENEWALS = 5
"""So often a lease is renewed within its time: some answers may be late or lost."""
LAST_WORDS_S = 2.0
"""So long a process that is stopped may take to keep what it still holds. [s]"""


class Claim:
    """Takes, renews and gives back a lease.

    Parameters
    ----------
    leases : Leases
    holder : str
        This life of this member.
    ttl_s : float
        Time of a lease. [s]
    clock : callable
        Clock that nobody sets. [s]
    """

    def __init__(
        self, leases: Leases, holder: str, ttl_s: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.holder = holder
        self.tenure = Tenure(0, float("-inf"))
        self.lease = Lease()
        self._leases = leases
        self._ttl_s = ttl_s
        self._clock = clock

    @property
    def is_owner(self) -> bool:
        """Whether this process may act now."""
        return not self.tenure.is_over(self._clock())

    async def take(self, *, is_ready: bool = True) -> bool:
        """Take the lease if nobody has it; whether it was taken. Who is not ready does not show that it stands by.

        Raises
        ------
        LinkError
            If the database does not answer in time.
        """
        holder = self.holder if is_ready else None
        return await self._ask(holder, lambda lease, now_s: lease.taken(self.holder, now_s, self._ttl_s))

    async def renew(self) -> bool:
        """Renew the lease; False if another has it.

        Raises
        ------
        LinkError
            If the database does not answer in time.
        """
        token = self.tenure.token
        return await self._ask(None, lambda lease, now_s: lease.renewed(token, now_s, self._ttl_s))

    async def release(self) -> None:
        """Give the lease back.

        Raises
        ------
        LinkError
            If the database does not answer in time.
        """
        token, self.tenure = self.tenure.token, Tenure(self.tenure.token, float("-inf"))
        await self._leases.change(None, lambda lease, _: lease.released(token))

    async def _ask(self, shown: str | None, change: Change) -> bool:
        asked_s = self._clock()
        lease = await self._leases.change(shown, change)
        if lease is None:
            return False
        self.lease, self.tenure = lease, Tenure.asked(lease.token, asked_s, self._ttl_s)
        return True


class Membership:
    """One role of a site, as one process has it.

    Parameters
    ----------
    settings : LeaseSettings
        With a `url`.
    service : str
        Such as "detector"; with the group it names the role.

    Raises
    ------
    ConfigError
        If there is no URL, or none that is one.
    """

    def __init__(self, settings: LeaseSettings, service: str) -> None:
        if settings.url is None:
            raise ConfigError("lease.url: missing")
        url, self._patience_s = settings.url.get_secret_value(), settings.ttl_s / 2.0
        self.name = f"{service}/{settings.group}"
        holder = f"{settings.member or socket.gethostname()}/{secrets.token_hex(4)}"
        self._service = service
        self._period_s = settings.ttl_s / RENEWALS
        self._databases = [LeaseDatabase(url, settings.password_file, self._patience_s) for _ in range(2)]
        self._claim = Claim(LeaseTable(self._databases[0], self.name), holder, settings.ttl_s)
        self._ledger = Ledger(self._databases[1], self.name)

    def close(self) -> None:
        """Close the connections; a lease that is still held ends with its time."""
        for database in self._databases:
            database.close()

    @property
    def token(self) -> int:
        """Token of the lease that was held last."""
        return self._claim.tenure.token

    @property
    def is_owner(self) -> bool:
        """Whether this process may act now."""
        return self._claim.is_owner

    def fence(self) -> Fence:
        """What keeps a connection to the same database from writing when the lease that is held now is over."""
        token = self.token
        return Fence(lambda database: check_token(database, self.name, token), unfrozen(self._patience_s))

    async def take(self, bus: Bus, is_ready: Callable[[], bool] = lambda: True) -> None:
        """Stand by until the lease is taken; only while the bus can be reached.

        Parameters
        ----------
        bus : Bus
        is_ready : callable
            Whether it could go on at once. One that could not takes the lease as well, if nobody has it, but does not
            show that it stands by.
        """
        log.info("role '%s': %s stands by", self.name, self._claim.holder)
        is_told = False
        while True:
            stands_by = bus.is_connected and is_ready()
            try:
                if bus.is_connected and await self._claim.take(is_ready=stands_by):
                    break
                is_told = False
            except LinkError as error:
                stands_by = False
                if not is_told:
                    log.warning("role '%s': %s; stands by", self.name, error)
                is_told = True
            self._report(stands_by=stands_by)
            await asyncio.sleep(self._period_s)
        self._report()
        log.warning("role '%s': %s is the owner, token %d", self.name, self._claim.holder, self.token)

    async def act(self, bus: Bus, work: Callable[[Outbox], Coroutine[Any, Any, None]]) -> None:
        """Act as the owner until the lease is lost, which is no error; stopped, keep what is left, and release it."""
        left = list[Outbox]()
        try:
            await self._act(bus, work, left)
        except asyncio.CancelledError:
            await self._finish(left)
            raise

    async def _act(
        self, bus: Bus, work: Callable[[Outbox], Coroutine[Any, Any, None]], outboxes: list[Outbox]
    ) -> None:
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self._hold(bus), name=f"{self.name}.hold")
                outbox = Outbox(bus, self._ledger, await self._inherit(), lambda: self._claim.tenure)
                outboxes.append(outbox)
                group.create_task(outbox.run(), name=f"{self.name}.outbox")
                group.create_task(work(outbox), name=f"{self.name}.work")
        except* LeaseLostError as lost:
            log.warning("role '%s': no owner any more: %s", self.name, _first(lost))
        self._report()

    async def _inherit(self) -> Inheritance:
        while True:
            try:
                return await self._ledger.inherit(self.token)
            except LinkError as error:
                log.warning("role '%s': %s", self.name, error)
            await asyncio.sleep(TRY_AGAIN_S)

    async def _hold(self, bus: Bus) -> None:
        """Renew the lease for ever; without a bus it is let go.

        Raises
        ------
        LeaseLostError
            When it is over, or another's.
        """
        while True:
            try:
                async with asyncio.timeout(self._claim.tenure.ends_s - time.monotonic()):
                    await asyncio.sleep(self._period_s)
                    if bus.is_connected and not await self._claim.renew():
                        raise LeaseLostError("another has taken the lease")
            except LinkError as error:
                log.warning("role '%s': %s", self.name, error)
            except TimeoutError as error:
                raise LeaseLostError("it could not be renewed in time") from error
            self._report()

    async def _finish(self, outboxes: list[Outbox]) -> None:
        try:
            async with asyncio.timeout(LAST_WORDS_S):
                for outbox in outboxes:
                    await outbox.flush()
                await self._claim.release()
        except (TimeoutError, LinkError, LeaseLostError) as error:
            log.warning("role '%s': %s", self.name, error or "the database does not answer")

    def _report(self, *, stands_by: bool = False) -> None:
        is_owner = self._claim.is_owner
        figures = {"is_owner": float(is_owner), "stands_by": float(stands_by), "lease_token": float(self.token)}
        if is_owner:
            figures["owner_since_s"] = self._claim.lease.since_s
        BOARD.report(SITE, f"{self._service}-lease", self._period_s, figures)


def _first(error: BaseException) -> BaseException:
    """The first error of a group of groups."""
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return error
