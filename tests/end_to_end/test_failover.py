"""A pair of daemons on a real PostgreSQL: its owner is killed, frozen, cut off, and gets a wrong clock."""

import asyncio
import contextlib
import json

import psycopg
import pytest
from detector_pair import Player, stations_of
from memory_bus import MemoryBus
from pair_site import PairSite

from wetwell.protocols.bus.keys import alarm_key, verdict_key
from wetwell.protocols.messages.alarm import Alarm, AlarmAct
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.timestamps import MAX_STAMP_NS, NS_PER_S, from_iso
from wetwell.services.alarms.client import send_act
from wetwell.services.alarms.service import AlarmService
from wetwell.services.alarms.station_clock import Now
from wetwell.services.historian.store.postgres_store import PostgresStore
from wetwell.services.runtime.settings import AlarmSettings
from wetwell.services.security.audit_chain import broken_among

pytestmark = [pytest.mark.check, pytest.mark.timeout(900)]

SPEED = 100.0
START_NS = from_iso("2026-01-01T00:00:00Z")
PUMPS = 3
SETTLE_S = 2.0


def files_of(folder, stations):
    return [word for one in stations for word in ("--station", str(folder / f"{one.name}.toml"))]


async def until(is_so):
    """Wait until something is so, or for a minute."""
    for _ in range(600):
        if await asyncio.to_thread(is_so):
            return
        await asyncio.sleep(0.1)


async def accidents(site, *kinds):
    """How long after each accident the successor had the lease; the last one is not undone."""
    return {kind: (await site.disturb(kind, is_undone=kind != kinds[-1])).taken_after_s for kind in kinds}


def test_of_two_detectors_one_tells_each_verdict_once_whatever_happens_to_it(postgres, tmp_path):
    stations = stations_of(tmp_path, 3)
    site = PairSite(postgres.url, tmp_path, ["detector", *files_of(tmp_path, stations)])
    player = Player(stations, SPEED, seed=11)

    async def run():
        async with site.running("a", "b"), player.playing(site.bus, site.endpoint):
            await asyncio.sleep(SETTLE_S)  # real processes: there is no virtual time here
            taken = await accidents(site, "freeze", "cut", "clock", "kill")
            await until(lambda: sum(len(one.verdicts) for one in player.heard.values()) > PUMPS * len(stations))
            await player.end_of_samples()
            await player.all_heard()
            await asyncio.sleep(SETTLE_S)
        return taken

    taken = asyncio.run(run())
    judged = player.judged()
    assert judged.expected > PUMPS * len(stations)  # so many say at first that they learn
    assert (judged.missing, judged.twice, judged.otherwise) == (0, 0, 0)
    assert min(taken["freeze"], taken["cut"], taken["kill"]) > 0.0


def verdict(number):
    """Of pumps in turn: a fault, and in the next round none."""
    time_ns, state = START_NS + 60 * number * NS_PER_S, ("pump_fault", "normal")[number // PUMPS % 2]
    fields = {"time": time_ns, "station": "alpha", "pump": number % PUMPS + 1, "window": (time_ns, time_ns)}
    return Verdict(state=state, probability={state: 0.995}, evidence={}, **fields)


def undisturbed(verdicts):
    """Changes of alarms that an alarms daemon tells which nobody disturbs."""
    bus = MemoryBus()
    heard = bus.subscribe(alarm_key("*"))
    service = AlarmService(bus, AlarmSettings(), (), lambda: Now(START_NS, 0.0))
    for one in verdicts:
        service.handle_verdict(one.encode())
        service.commit()
    return [Alarm.decode(payload) for payload in asyncio.run(heard.receive())]


def told(alarms):
    return [(one.id, one.time, one.state) for one in alarms if one.pump is not None and not one.by]


@pytest.mark.long
def test_of_two_alarm_daemons_one_raises_each_alarm_once_and_carries_out_each_act_once(postgres, tmp_path):
    site = PairSite(postgres.url, tmp_path, ["alarms"])
    sent, heard, acts = [], [], []

    async def publish(bus):
        publishers = [bus.publisher(verdict_key("alpha", pump), history=100) for pump in range(1, PUMPS + 1)]
        while True:
            sent.append(verdict(len(sent)))
            publishers[sent[-1].pump - 1].put(sent[-1].encode())
            await asyncio.sleep(0.1)

    async def hear(subscription):
        while True:
            heard.extend(Alarm.decode(payload) for payload in await subscription.receive())

    async def act(bus):
        await until(lambda: heard)  # an act on a station that nobody knows is refused
        while True:
            fields = {"station": "alpha", "alarm": "level_high", "by": "ann", "minutes": 5.0}
            kind = ("shelve", "unshelve")[len(acts) % 2]
            one = AlarmAct.model_validate({"id": f"act-{len(acts)}", "act": kind} | fields)
            acts.append((one.id, (await send_act(bus, one)).is_done))

    async def run():
        async with site.running("a", "b"):
            hearing = asyncio.create_task(hear(site.bus.subscribe(alarm_key("*"), history=1)))
            publishing, acting = asyncio.create_task(publish(site.bus)), asyncio.create_task(act(site.bus))
            await asyncio.sleep(SETTLE_S)
            await accidents(site, "freeze", "cut", "kill")
            await asyncio.sleep(SETTLE_S)
            for task in (publishing, acting):
                task.cancel()
            wanted = told(await asyncio.to_thread(undisturbed, sent))
            await until(lambda: len(told(heard)) >= len(wanted))
            await asyncio.sleep(SETTLE_S)
            hearing.cancel()
            return wanted

    wanted = asyncio.run(run())
    assert sorted(told(heard), key=lambda one: one[1]) == sorted(wanted, key=lambda one: one[1])
    assert acts
    assert all(is_done for _, is_done in acts)
    with psycopg.connect(postgres.url) as database:
        query = "SELECT text FROM wetwell.line WHERE role = %s ORDER BY number"
        lines = [line for (line,) in database.execute(query, (f"alarms/{tmp_path.name}",))]
    assert broken_among(lines) == []
    written = [json.loads(line)["id"] for line in lines]
    assert len(written) == len(set(written))
    assert {name for name, _ in acts} <= set(written)


@pytest.mark.long
def test_of_two_historians_each_sample_is_kept_once(postgres, tmp_path):
    stations = stations_of(tmp_path, 2)
    site = PairSite(postgres.url, tmp_path, ["historian"])
    player = Player(stations, SPEED, seed=5)
    with psycopg.connect(postgres.url, autocommit=True) as database:
        database.execute("DROP SCHEMA IF EXISTS wetwell CASCADE")

    async def run():
        async with site.running("a", "b"), player.playing(site.bus, site.endpoint):
            await asyncio.sleep(SETTLE_S)
            await accidents(site, "freeze", "cut", "kill")
            await player.end_of_samples()
            await until(lambda: all(len(kept(one)) >= player.sent for one in stations))

    def kept(station):
        with contextlib.closing(PostgresStore(postgres.url, is_alone=False)) as store:
            return store.samples(station.name, 0, MAX_STAMP_NS).seq.tolist()

    asyncio.run(run())
    for station in stations:
        assert kept(station) == list(range(player.sent))
