"""Sources that end before they have gathered for long enough send what they have."""

import asyncio
import contextlib
import signal

import pytest
from memory_bus import MemoryBus

from wetwell.protocols.bus.keys import sample_block_key
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.modbus.device_map import load_plcs
from wetwell.protocols.modbus.registers import register_csv, register_table
from wetwell.protocols.modbus.server import ModbusServer
from wetwell.services.gateway.daemon import poll_all
from wetwell.services.replay.daemon import serve_replay
from wetwell.services.runtime.sample_sender import SampleSender
from wetwell.services.runtime.settings import Settings
from wetwell.services.simulator.daemon import PlantStart, serve_simulator
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

GATHER_S = 30.0
SETTINGS = Settings.model_validate({"zenoh": {"gather_s": GATHER_S}})


@pytest.fixture
def bus(monkeypatch):
    """Bus that replay and simulator connect to."""
    with MemoryBus() as bus:

        async def connect(_):
            return bus

        for service in ("replay", "simulator"):
            monkeypatch.setattr(f"wetwell.services.{service}.daemon.connect", connect)
        yield bus


async def sent(bus, station="alpha") -> list[list[int]]:
    """Numbers of the samples of each message."""
    heard = bus.subscribe(sample_block_key(station), history=100)
    async with asyncio.timeout(1.0):
        return [list(SampleBlock.decode(payload).seq) for payload in await heard.receive()]


def test_a_short_replay_sends_all_its_samples_at_its_end(alpha, bus):
    recording = Simulation(alpha, Scenario(name="plain"), 1).advance(7)

    async def run():
        await serve_replay(SETTINGS, recording, "alpha", 1000.0)
        return await sent(bus)

    assert asyncio.run(run()) == [list(range(7))]


def test_a_simulator_that_is_stopped_sends_what_it_has_gathered(alpha, bus):
    simulation = Simulation(alpha, Scenario(name="plain"), 1)

    async def run():
        serving = asyncio.create_task(
            serve_simulator(SETTINGS, simulation, 20.0, PlantStart(), zenoh=True, modbus=False)
        )
        async with asyncio.timeout(20.0):
            while simulation.seconds < 3:  # noqa: ASYNC110 - nothing else tells it
                await asyncio.sleep(0.01)
            assert bus.get(sample_block_key("alpha")) is None
            signal.raise_signal(signal.SIGTERM)
            await serving
        return await sent(bus)

    assert asyncio.run(run()) == [list(range(simulation.seconds))]


def plcs_of(folder, port, *stations):
    """PLCs that are all the one at a port."""
    (folder / "map.csv").write_text(register_csv(register_table(1, 1)))
    for station in stations:
        (folder / f"{station}.toml").write_text(
            f'station = "{station}"\nhost = "127.0.0.1"\nport = {port}\npumps = 1\nmap = "map.csv"\nperiod_s = 0.05\n'
        )
    return [plc for station in stations for plc in load_plcs(folder / f"{station}.toml")]


@contextlib.asynccontextmanager
async def polling(bus, folder, *stations):
    """A gateway that has gathered samples of each station, and is then cancelled."""
    taken = {station: asyncio.Event() for station in stations}
    put = SampleSender.put

    def put_and_tell(sender, sample):
        put(sender, sample)
        taken[sample.station].set()

    server = ModbusServer(
        host="127.0.0.1", port=0, unit_id=1, word_order="ABCD", pumps=1, levels=1, on_write=lambda _: None
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SampleSender, "put", put_and_tell)
        async with server:
            server.update({"level_m": 1.25})
            plcs = plcs_of(folder, server.port, *stations)
            gateway = asyncio.create_task(poll_all(bus, plcs, 1.0, 0.1, GATHER_S))
            async with asyncio.timeout(20.0):
                for event in taken.values():
                    await event.wait()
            assert all(bus.get(sample_block_key(station)) is None for station in stations)
            yield gateway


def test_a_gateway_that_is_cancelled_sends_what_it_has_gathered(tmp_path):
    async def run():
        with MemoryBus() as bus:
            async with polling(bus, tmp_path, "alpha", "beta") as gateway:
                gateway.cancel()
                with pytest.raises(asyncio.CancelledError):
                    await gateway
                return [await sent(bus, station) for station in ("alpha", "beta")]

    for (message,) in asyncio.run(run()):
        assert message == list(range(len(message)))


@pytest.mark.parametrize("broken", ["alpha", "beta"])
def test_what_cannot_be_sent_of_one_station_keeps_no_other_from_being_sent(broken, tmp_path):
    class BrokenBus(MemoryBus):
        def put(self, key, payload, weight=1):
            if key == sample_block_key(broken):
                raise RuntimeError("the link is broken")
            super().put(key, payload, weight)

    async def run():
        with BrokenBus() as bus:
            async with polling(bus, tmp_path, "alpha", "beta") as gateway:
                gateway.cancel()
                with pytest.raises(RuntimeError, match="the link is broken"):
                    await gateway
                (whole,) = {"alpha", "beta"} - {broken}
                return await sent(bus, whole)

    assert asyncio.run(run())
