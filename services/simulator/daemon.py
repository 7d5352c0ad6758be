"""The simulator daemon: a plant that lives, seen on Zenoh, on Modbus TCP, or on both."""

import asyncio
import contextlib
import logging
import math
import ssl
from collections.abc import Callable
from dataclasses import dataclass

from wetwell.protocols.bus.keys import plant_clock_key
from wetwell.protocols.errors import ConfigError
from wetwell.protocols.modbus.server import ModbusServer
from wetwell.protocols.modbus.write_permission import WritePermission
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.protocols.tls import server_context
from wetwell.services.runtime.clock import tick_period_s
from wetwell.services.runtime.connection import connect
from wetwell.services.runtime.lifecycle import report_health, run_until_stopped, ticks
from wetwell.services.runtime.sample_sender import SampleSender
from wetwell.services.runtime.settings import ModbusSettings, Settings
from wetwell.services.security.audit import Audit, audit_in
from wetwell.services.security.exposure import is_loopback
from wetwell.services.simulator.orders import obey
from wetwell.services.simulator.pace import Pace
from wetwell.services.simulator.write_log import WriteLog
from wetwell.simulator.simulation import Simulation

log = logging.getLogger(__name__)

Sink = Callable[[Recording], None]

PASSED_AT_ONCE_S = 86_400
"""Seconds that are passed over in one piece: a day is some tens of MB."""


@dataclass(frozen=True)
class PlantStart:
    """Where a live plant begins, and where it stands until an order lets it go.

    Attributes
    ----------
    begin_s : int
        So many seconds of it were told before: they are simulated and not told again. [s]
    is_held : bool
        Whether it stands at its beginning.
    stands_at_end : bool
        Whether it stands where its scenario ends.
    """

    begin_s: int = 0
    is_held: bool = False
    stands_at_end: bool = False


async def serve_simulator(
    settings: Settings, simulation: Simulation, speed: float, start: PlantStart, *, zenoh: bool, modbus: bool
) -> None:
    """Run a plant until stopped; its kernels are compiled, or loaded, before its clock runs.

    Parameters
    ----------
    settings : Settings
    simulation : Simulation
        At its beginning.
    speed : float
        Seconds of the plant in a second on the wall.
    start : PlantStart
    zenoh, modbus : bool
        Where it is seen.

    Raises
    ------
    ConfigError
        If the settings of Modbus name a register that is not there, or a file that cannot be read.
    LinkError
        If the Modbus port cannot be opened. A router that is away is waited for.
    """
    work = _run(settings, simulation, speed, start, zenoh=zenoh, modbus=modbus)
    await run_until_stopped(work, "simulator.run")
    log.info("stopped after %d s of station '%s'", simulation.seconds, simulation.station.name)


async def _run(
    settings: Settings, simulation: Simulation, speed: float, start: PlantStart, *, zenoh: bool, modbus: bool
) -> None:
    name, clock = simulation.station.name, asyncio.get_running_loop().time
    pace, changed = Pace(speed, clock(), is_held=True), asyncio.Event()
    async with contextlib.AsyncExitStack() as stack:
        audit = audit_in(settings.security.audit_dir, "simulator")
        sinks = [await _modbus_sink(settings, simulation, audit, stack)] if modbus else []
        await asyncio.to_thread(_make_ready, simulation, start.begin_s)
        async with asyncio.TaskGroup() as group:
            if zenoh:
                bus = stack.enter_context(await connect(settings))
                sender = SampleSender(bus, name, settings.zenoh.gather_s, pace.full_speed)
                stack.callback(sender.flush)
                sinks.append(_zenoh_sink(sender, simulation))
                orders = bus.answer(plant_clock_key(name))
                group.create_task(
                    obey(orders, name, pace, lambda: simulation.seconds, changed), name="simulator.clock"
                )

                def figures() -> dict[str, float]:
                    return {
                        "seconds": float(simulation.seconds),
                        "speed": pace.speed,
                        "full_speed": pace.full_speed,
                        "held": float(pace.is_held),
                        "audit_errors": float(audit.errors),
                    }

                group.create_task(
                    report_health(bus, name, "simulator", settings.health.period_s, figures, news=changed),
                    name="simulator.health",
                )
            if not start.is_held:
                pace.release(clock())
            end_s = math.ceil(simulation.scenario.duration_s) if start.stands_at_end else 0
            group.create_task(_live(simulation, pace, sinks, end_s, changed), name="simulator.live")


def _make_ready(simulation: Simulation, begin_s: int) -> None:
    """Compile, or load, what moves the plant on, and pass over the seconds that were told before."""
    Simulation(simulation.station, simulation.scenario, seed=0).advance(1, truth=False)
    while simulation.seconds < begin_s:
        simulation.advance(min(begin_s - simulation.seconds, PASSED_AT_ONCE_S), truth=False)


async def _live(simulation: Simulation, pace: Pace, sinks: list[Sink], end_s: int, changed: asyncio.Event) -> None:
    """Let the plant live for ever; where it passes its end it stands once, and sets `changed`."""
    station, scenario = simulation.station.name, simulation.scenario.name
    log.info("station '%s', scenario '%s', speed %g", station, scenario, pace.full_speed)
    clock = asyncio.get_running_loop().time
    async for _ in ticks(tick_period_s(pace.full_speed)):
        due = pace.take_due(clock())
        if simulation.seconds < end_s <= simulation.seconds + due:
            due = end_s - simulation.seconds
            pace.hold(clock())
            changed.set()
        if due > 0:
            recording = simulation.advance(due, truth=False)
            for sink in sinks:
                sink(recording)


def _zenoh_sink(sender: SampleSender, simulation: Simulation) -> Sink:
    def publish(recording: Recording) -> None:
        for sample in recording.samples(simulation.station.name, first_seq=simulation.seconds - len(recording)):
            sender.put(sample)

    return publish


def tls_of(modbus: ModbusSettings) -> ssl.SSLContext | None:
    """What the Modbus server needs for TLS; None where no certificate is set. Warns if everybody may read.

    Raises
    ------
    ConfigError
        If a certificate, its key or the authority is missing or cannot be read.
    """
    tls = modbus.tls
    if not is_loopback(modbus.host) and tls.client_ca is None:
        log.warning(
            "Modbus TCP on %s: whoever reaches it may read, for Modbus knows no passwords; writes are held against"
            " modbus.write_allow (set modbus.tls, or put a firewall before it)",
            modbus.host,
        )
    if tls.certificate is None and tls.private_key is None and tls.client_ca is None:
        return None
    if tls.certificate is None or tls.private_key is None:
        raise ConfigError("modbus.tls: certificate and private_key are both needed")
    return server_context(tls.certificate, tls.private_key, tls.client_ca, f"Modbus TCP {modbus.host}:{modbus.port}")


async def _modbus_sink(
    settings: Settings, simulation: Simulation, audit: Audit, stack: contextlib.AsyncExitStack
) -> Sink:
    try:
        server = ModbusServer(
            host=settings.modbus.host,
            port=settings.modbus.port,
            unit_id=settings.modbus.unit_id,
            word_order=settings.modbus.word_order,
            pumps=len(simulation.station.pump),
            levels=len(simulation.station.control.start_levels_m),
            on_write=simulation.change_settings,
            witness=WriteLog(audit, simulation.station.name).note,
            tls=tls_of(settings.modbus),
            write_allow=[WritePermission(rule.client, rule.registers) for rule in settings.modbus.write_allow],
        )
    except ValueError as error:
        raise ConfigError(str(error)) from error
    await stack.enter_async_context(server)
    server.update(simulation.settings)

    def show(recording: Recording) -> None:
        values: dict[str, float | None] = {name: float(column[-1]) for name, column in recording.columns.items()}
        values["heartbeat"] = simulation.seconds % 65536
        values["time_s"] = int(recording.time_ns[-1]) // NS_PER_S
        server.update(values | simulation.settings)

    return show
