"""The simulator daemon: a plant that lives, seen on Zenoh, on Modbus TCP, or on both."""

import asyncio
import contextlib
import logging
import ssl
from collections.abc import Callable

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.modbus.server import ModbusServer
from wetwell.protocols.modbus.write_permission import WritePermission
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.protocols.tls import server_context
from wetwell.services.runtime.clock import due_seconds, tick_period_s
from wetwell.services.runtime.connection import connect
from wetwell.services.runtime.lifecycle import report_health, run_until_stopped, ticks
from wetwell.services.runtime.sample_sender import SampleSender
from wetwell.services.runtime.settings import ModbusSettings, Settings
from wetwell.services.security.exposure import is_loopback
from wetwell.simulator.simulation import Simulation

log = logging.getLogger(__name__)

Sink = Callable[[Recording], None]


async def serve_simulator(
    settings: Settings, simulation: Simulation, speed: float, *, zenoh: bool, modbus: bool
) -> None:
    """Run a plant until stopped.

    Raises
    ------
    ConfigError
        If the settings of Modbus name a register that is not there, or a file that cannot be read.
    LinkError
        If the Modbus port cannot be opened. A router that is away is waited for.
    """
    await run_until_stopped(_run(settings, simulation, speed, zenoh=zenoh, modbus=modbus), "simulator.run")
    log.info("stopped after %d s of station '%s'", simulation.seconds, simulation.station.name)


async def _run(settings: Settings, simulation: Simulation, speed: float, *, zenoh: bool, modbus: bool) -> None:
    async with contextlib.AsyncExitStack() as stack:
        sinks = [await _modbus_sink(settings, simulation, stack)] if modbus else []
        async with asyncio.TaskGroup() as group:
            if zenoh:
                bus = stack.enter_context(await connect(settings))
                sender = SampleSender(bus, simulation.station.name, settings.zenoh.gather_s)
                stack.callback(sender.flush)
                sinks.append(_zenoh_sink(sender, simulation))
                group.create_task(
                    report_health(
                        bus,
                        simulation.station.name,
                        "simulator",
                        settings.health.period_s,
                        lambda: {"seconds": float(simulation.seconds), "speed": speed},
                    ),
                    name="simulator.health",
                )
            group.create_task(_live(simulation, speed, sinks), name="simulator.live")


async def _live(simulation: Simulation, speed: float, sinks: list[Sink]) -> None:
    log.info("station '%s', scenario '%s', speed %g", simulation.station.name, simulation.scenario.name, speed)
    first = simulation.seconds
    never = asyncio.Event()
    async for elapsed_s in ticks(tick_period_s(speed), never):
        due = due_seconds(elapsed_s, speed, simulation.seconds - first)
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


async def _modbus_sink(settings: Settings, simulation: Simulation, stack: contextlib.AsyncExitStack) -> Sink:
    try:
        server = ModbusServer(
            host=settings.modbus.host,
            port=settings.modbus.port,
            unit_id=settings.modbus.unit_id,
            word_order=settings.modbus.word_order,
            pumps=len(simulation.station.pump),
            levels=len(simulation.station.control.start_levels_m),
            on_write=simulation.change_settings,
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
