"""A live plant whose clock takes orders: held, let go, slowed down, and what others make of a plant that stands."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable

import pytest
from memory_bus import MemoryBus

from wetwell.protocols.bus.keys import alive_key, plant_clock_key, sample_key, status_key
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.plant_clock import PlantClockOrder
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.status import Status
from wetwell.services.alarms.service import AlarmService
from wetwell.services.alarms.station_clock import Now
from wetwell.services.dashboard.past.client import plant_clock_order, set_plant_clock
from wetwell.services.dashboard.refusal import RefusalError
from wetwell.services.runtime.settings import AlarmSettings, Settings
from wetwell.services.simulator import daemon
from wetwell.services.simulator.daemon import PlantStart, serve_simulator
from wetwell.services.supervisor.plant_control import PlantControl
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

SPEED = 600.0


@pytest.fixture
def bus(monkeypatch):
    with MemoryBus() as bus:

        async def connect(_: Settings) -> MemoryBus:
            return bus

        monkeypatch.setattr(daemon, "connect", connect)
        yield bus


@contextlib.asynccontextmanager
async def plant(bus: MemoryBus, alpha, start: PlantStart, **scenario: object) -> AsyncIterator[Simulation]:
    simulation = Simulation(alpha, Scenario(name="plain", **scenario), 1)
    serving = asyncio.create_task(
        serve_simulator(Settings(), simulation, SPEED, start, zenoh=True, modbus=False), name="serving"
    )
    try:
        await until(lambda: alive_key("alpha", "simulator") in bus.alive)
        yield simulation
    finally:
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)


async def until(is_so: Callable[[], bool]) -> None:
    async with asyncio.timeout(240.0):
        while not is_so():  # noqa: ASYNC110 - the plant runs by the wall
            await asyncio.sleep(0.005)


def figures(bus: MemoryBus) -> dict[str, float]:
    payload = bus.get(status_key("alpha", "simulator"))
    return {} if payload is None else Status.decode(payload).figures


def test_it_stands_until_it_is_let_go_and_obeys(alpha, bus):
    async def run() -> None:
        async with plant(bus, alpha, PlantStart(is_held=True)) as simulation:
            control = PlantControl(bus, "alpha")
            await until(lambda: bool(figures(bus)))
            assert (simulation.seconds, figures(bus)["held"], figures(bus)["full_speed"]) == (0, 1.0, SPEED)
            assert not (await control.release()).is_held
            await until(lambda: simulation.seconds > 0)
            assert (await control.slower()).speed == 60.0
            assert (await control.faster()).speed == SPEED
            assert (await control.look(5.0)).speed == 60.0
            assert (await control.toggle()).is_held
            seconds = simulation.seconds
            await until(lambda: figures(bus)["held"] == 1.0)
            assert figures(bus)["seconds"] == seconds
            with pytest.raises(MessageError, match="speed: got -1"):
                await control.order(PlantClockOrder.model_construct(speed=-1.0))
            assert simulation.seconds == seconds

    asyncio.run(run())


def test_the_page_sends_the_same_orders_and_says_what_is_wrong(alpha, bus):
    async def run() -> None:
        async with plant(bus, alpha, PlantStart()):
            assert (await set_plant_clock(bus, "alpha", plant_clock_order(b'{"is_held": true}')))["is_held"]
            with pytest.raises(RefusalError, match="speed: got 0"):
                plant_clock_order(b'{"speed": 0}')
            with pytest.raises(RefusalError, match="station 'beta' has no simulated plant"):
                await set_plant_clock(bus, "beta", PlantClockOrder())

    asyncio.run(run())


def test_it_stands_once_where_its_scenario_ends_and_then_goes_on(alpha, bus):
    async def run() -> None:
        async with plant(bus, alpha, PlantStart(stands_at_end=True), duration_s=50.0) as simulation:
            await until(lambda: figures(bus).get("held") == 1.0)
            assert simulation.seconds == 50
            await PlantControl(bus, "alpha").release()
            await until(lambda: simulation.seconds > 50)

    asyncio.run(run())


def test_what_was_told_before_is_not_told_again(alpha, bus):
    async def run() -> Sample:
        async with plant(bus, alpha, PlantStart(begin_s=90_000)):
            await until(lambda: bus.get(sample_key("alpha")) is not None)
            return Sample.decode((await bus.subscribe(sample_key("alpha"), history=10_000).receive())[0])

    first = asyncio.run(run())
    whole = Simulation(alpha, Scenario(name="plain"), 1).advance(90_001, truth=False)
    assert (first.seq, first.time, first.level_m) == (90_000, whole.time_ns[-1], whole.column("level_m")[-1])


def test_alarms_miss_no_samples_of_a_plant_that_is_held(alpha, bus):
    now_s = 0.0
    service = AlarmService(bus, AlarmSettings(), [alpha], lambda: Now(0, now_s))
    service.handle_sample(Sample(station="alpha", seq=0, time=0, level_m=1.0, pumps=()).encode())
    status = {"time": 0, "station": "alpha", "service": "simulator", "state": "running"}

    def is_missed(held: float, at_s: float) -> bool:
        nonlocal now_s
        now_s = at_s
        service.handle_status(Status(**status, figures={"held": held}).encode())
        service.look()
        record = service.registry.records.get(("alpha", "samples_stale"))
        return record is not None and record.status.is_active

    assert not is_missed(1.0, 1_000.0)
    assert not is_missed(0.0, 1_030.0), "its absence counts from when it was let go"
    assert is_missed(0.0, 1_100.0)


def test_alarms_miss_nothing_of_a_plant_that_is_not_let_go_yet(alpha, bus):
    now_s = 0.0
    service = AlarmService(bus, AlarmSettings(), [alpha], lambda: Now(0, now_s), is_held=True)
    status = {"time": 0, "station": "alpha", "service": "simulator", "state": "running"}

    def missed(at_s: float) -> set[str]:
        nonlocal now_s
        now_s = at_s
        service.look()
        return {rule for (_, rule), record in service.registry.records.items() if record.status.is_active}

    assert missed(1.0) | missed(1_000.0) == set(), "kernels may take their time to compile"
    service.handle_status(Status(**status, figures={"held": 0.0}).encode())
    assert missed(1_030.0) == set()
    assert missed(1_031.0) == {"detector_silent"}
    assert missed(1_061.0) == {"detector_silent", "samples_stale"}


def test_an_order_that_is_none_is_answered(alpha, bus):
    async def run() -> list[bytes]:
        async with plant(bus, alpha, PlantStart(is_held=True)):
            return await bus.ask(plant_clock_key("alpha"), b"go faster")

    (answer,) = asyncio.run(run())
    assert b"Invalid JSON" in answer or b"invalid JSON" in answer
