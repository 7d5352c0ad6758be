"""The historian daemon: bus, clock and threads around `Historian`."""

import asyncio
import contextlib
import logging
from collections.abc import Iterator

from wetwell.protocols.bus.interface import ALL_KEPT, Bus, Request, Subscription
from wetwell.protocols.bus.keys import (
    ROOT,
    SITE,
    alarm_key,
    history_key,
    maintenance_key,
    sample_block_key,
    sample_key,
    verdict_key,
)
from wetwell.protocols.errors import ConfigError, WetwellError
from wetwell.services.historian.service import Historian, PayloadKind
from wetwell.services.historian.store.opening import open_store
from wetwell.services.runtime.clock import now_ns
from wetwell.services.runtime.connection import connect
from wetwell.services.runtime.folder_lock import look_for_ever
from wetwell.services.runtime.lifecycle import report_health, run_until_stopped
from wetwell.services.runtime.settings import Settings

log = logging.getLogger(__name__)

VERDICT_HISTORY = 100
ALARM_HISTORY = 100
MAINTENANCE_HISTORY = 100
CAPACITY = 200_000
"""Most messages of one kind that wait to be taken; what publishers hold comes when there is room."""
PACE_S = 0.1
"""A tenth of the time between two commits: to take each message as it comes costs more than to keep it. [s]"""
ANSWERS_AT_ONCE = 4
"""Questions that are answered at the same time: a page of a station asks about as many."""

PAYLOADS_AT_ONCE = 1_000
"""Payloads that are taken before the other tasks have their turn."""


async def serve_historian(settings: Settings) -> None:
    """Keep history until stopped; what has come until then is kept. A router that is away is waited for."""
    await run_until_stopped(_run(settings), "historian.run")


async def _run(settings: Settings) -> None:
    if settings.lease.url is not None:
        await _keep_in_turn(settings)
    periods_s = settings.historian.commit_s, settings.historian.maintain_s, settings.health.period_s
    with open_store(settings.historian) as store:
        historian = Historian(store, spool_rows=settings.historian.spool_rows)
        try:
            while True:
                with await connect(settings) as bus, _again_after_damage():
                    await keep(bus, historian, *periods_s)
        finally:
            _finish(historian)


async def _keep_in_turn(settings: Settings) -> None:
    """Keep history for ever while this process owns the role; stand by while it does not.

    What comes between two owners is with the publishers.

    Raises
    ------
    ConfigError
        If the history is not in the database of the lease: only there one transaction sees both.
    """
    from wetwell.services.historian.store.postgres_store import PostgresStore  # noqa: PLC0415 - each site has one
    from wetwell.services.lease.membership import Membership  # noqa: PLC0415 - only pairs need it

    kept, url = settings.historian, settings.historian.url
    if url is None or url != settings.lease.url:
        raise ConfigError("historian.url: must be the same as lease.url, where that is set")
    with contextlib.closing(Membership(settings.lease, "historian")) as role:
        while True:
            with await connect(settings) as bus:
                await role.take(bus)

                async def work(_: object, bus: Bus = bus) -> None:
                    fence = role.fence()
                    store = PostgresStore(
                        url.get_secret_value(),
                        password_file=kept.password_file,
                        is_alone=False,
                        fence=fence,
                        keep_live_days=kept.keep_live_days,
                        downsample_after_days=kept.downsample_after_days,
                        keep_days=kept.keep_days,
                    )
                    with contextlib.closing(store):
                        historian = Historian(store, spool_rows=kept.spool_rows)
                        try:
                            await keep(bus, historian, kept.commit_s, kept.maintain_s, settings.health.period_s)
                        finally:
                            if role.is_owner:
                                _finish(historian)
                            else:
                                store.hang_up()

                await role.act(bus, work)


@contextlib.contextmanager
def _again_after_damage() -> Iterator[None]:
    try:
        yield
    except* DamagedHistoryError:
        log.warning("what was lost is taken from the publishers, as far as they keep it")


def _finish(historian: Historian) -> None:
    """Keep what is left."""
    historian.commit(now_ns())
    waiting = historian.figures(now_ns())["waiting"]
    if waiting:
        log.error(
            "%d samples and messages could not be kept and are lost, but for what their publishers still have",
            waiting,
        )


class DamagedHistoryError(WetwellError):
    """Something that was kept was damaged, and is put aside: what publishers still have is to be taken anew."""


async def keep(bus: Bus, historian: Historian, commit_s: float, maintain_s: float, health_s: float) -> None:
    """Take, commit, maintain, answer and report for ever.

    Raises
    ------
    ExceptionGroup
        With a `DamagedHistoryError` if something has to be fetched again, on a new connection; with a `StoreError`
        once another folder is in the place of that of the history.
    """
    subscriptions: dict[PayloadKind, Subscription[bytes]] = {
        "samples": bus.subscribe(sample_key("*"), history=ALL_KEPT, capacity=CAPACITY, pace_s=PACE_S),
        "blocks": bus.subscribe(sample_block_key("*"), history=ALL_KEPT, capacity=CAPACITY, pace_s=PACE_S),
        "verdicts": bus.subscribe(verdict_key("*"), history=VERDICT_HISTORY, capacity=CAPACITY, pace_s=PACE_S),
        "alarms": bus.subscribe(alarm_key("*"), history=ALARM_HISTORY, capacity=CAPACITY, pace_s=PACE_S),
        "maintenance": bus.subscribe(
            maintenance_key("*"), history=MAINTENANCE_HISTORY, capacity=CAPACITY, pace_s=PACE_S
        ),
    }
    questions = bus.answer(history_key("*"))

    def figures() -> dict[str, float]:
        dropped = sum(subscription.dropped for subscription in subscriptions.values())
        missed = sum(subscription.missed for subscription in subscriptions.values())
        return historian.figures(now_ns()) | {"dropped": float(dropped), "missed": float(missed)}

    async with asyncio.TaskGroup() as group:
        for kind, subscription in subscriptions.items():
            group.create_task(_handle(historian, kind, subscription), name=f"historian.{kind}")
        group.create_task(look_for_ever(historian.check_place), name="historian.hold")
        group.create_task(_commit(historian, commit_s), name="historian.commit")
        group.create_task(_maintain(historian, maintain_s), name="historian.maintain")
        group.create_task(_answer(historian, questions), name="historian.answer")
        group.create_task(report_health(bus, SITE, "historian", health_s, figures), name="historian.health")


async def _handle(historian: Historian, kind: PayloadKind, subscription: Subscription[bytes]) -> None:
    while True:
        for number, payload in enumerate(await subscription.receive(), start=1):
            historian.handle(kind, payload)
            if number % PAYLOADS_AT_ONCE == 0:
                await asyncio.sleep(0)


async def _commit(historian: Historian, period_s: float) -> None:
    damages = historian.damages
    while True:
        await asyncio.sleep(period_s)
        await asyncio.to_thread(historian.commit, now_ns())
        if historian.damages > damages:
            raise DamagedHistoryError("something that was kept was damaged")


async def _maintain(historian: Historian, period_s: float) -> None:
    while True:
        while await asyncio.to_thread(historian.maintain, now_ns()):
            pass
        await asyncio.sleep(period_s)


async def _answer(historian: Historian, questions: Subscription[Request]) -> None:
    """Answer some questions at a time, so that a long one does not hold up the others."""
    gate = asyncio.Semaphore(ANSWERS_AT_ONCE)

    async def reply(request: Request) -> None:
        station = request.key.removeprefix(f"{ROOT}/").removesuffix("/history")
        try:
            request.reply(await asyncio.to_thread(historian.answer, station, request.payload))
        finally:
            gate.release()

    async with asyncio.TaskGroup() as group:
        while True:
            for request in await questions.receive():
                await gate.acquire()
                group.create_task(reply(request), name="historian.reply")
