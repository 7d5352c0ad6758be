"""All checks of the doctor, in order, and those that need no bus: files, router, Modbus port, disk, versions."""

import asyncio
import platform
import shutil
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.station.station_file import Station
from wetwell.services.doctor.checks import LEAST_FREE_BYTES, findings_of
from wetwell.services.doctor.finding import Finding
from wetwell.services.doctor.leases import lease_findings
from wetwell.services.doctor.survey import listen
from wetwell.services.runtime.connection import connect
from wetwell.services.runtime.settings import ModbusSettings, Settings, load_settings
from wetwell.services.stations import find_station

ROUTER_S = 5.0
MODBUS_S = 3.0
READ_FIRST_INPUT = "000100000006{unit:02x}0400000001"
"""Modbus TCP: read one input register at address 0."""


async def examine(config: Path | None, zenoh: str | None, stations: Sequence[str], seconds: float) -> list[Finding]:
    """Everything that the doctor finds.

    Parameters
    ----------
    config, zenoh
        Settings file and endpoint, as for every command.
    stations : sequence of str
        Station files that the site is to have.
    seconds : float
        How long the bus is listened to. [s]
    """
    findings = [version_finding()]
    try:
        settings = load_settings(config, {} if zenoh is None else {"zenoh": {"endpoint": zenoh}})
    except ConfigError as error:
        return [*findings, Finding("settings", "error", str(error), "correct it; wetwell config check FILE")]
    findings.append(Finding("settings", "ok", "settings are valid"))
    known = [found for name in stations for found in [_station(name, findings)] if found is not None]
    findings += _disks(settings)
    findings.append(await _modbus(settings.modbus))
    findings += await lease_findings(settings.lease)
    try:
        async with asyncio.timeout(ROUTER_S):
            bus = await connect(settings)
    except TimeoutError:
        text = f"no router at {settings.zenoh.endpoint} within {ROUTER_S:g} s"
        advice = "start it: wetwell router; a wrong password looks the same: see its log"
        return [*findings, Finding("router", "error", text, advice)]
    with bus:
        findings.append(Finding("router", "ok", f"the router at {settings.zenoh.endpoint} answers"))
        survey = await listen(bus, seconds)
    return [*findings, *findings_of(survey, [station.name for station in known], settings.health.max_sample_age_s)]


def version_finding() -> Finding:
    """What runs here."""
    names = ("wetwell", "eclipse-zenoh", "pymodbus")
    text = ", ".join([*(f"{name} {version(name)}" for name in names), f"Python {platform.python_version()}"])
    return Finding("versions", "ok", text)


def _station(name: str, findings: list[Finding]) -> Station | None:
    try:
        station = find_station(name)
    except ConfigError as error:
        findings.append(Finding("station", "error", str(error), f"correct it; wetwell station check {name}"))
        return None
    findings.append(Finding("station", "ok", f"{name}: station '{station.name}' is valid"))
    return station


def _disks(settings: Settings) -> list[Finding]:
    folders = {
        "detector.state_dir": settings.detector.state_dir,
        "alarms.state_dir": settings.alarms.state_dir,
        "security.audit_dir": settings.security.audit_dir,
    }
    findings = []
    for setting, folder in folders.items():
        if folder is None:
            continue
        try:
            free = shutil.disk_usage(folder).free
        except OSError as error:
            text = f"{setting}: {folder}: {error.strerror}"
            findings.append(Finding("disk", "error", text, "make the folder, or set another"))
            continue
        is_low = free < LEAST_FREE_BYTES
        text = f"{setting}: {free / 1e9:.1f} GB free"
        advice = "make room, before state and audit cannot be written" if is_low else ""
        findings.append(Finding("disk", "warning" if is_low else "ok", text, advice))
    return findings


async def _modbus(settings: ModbusSettings) -> Finding:
    """Whether a Modbus server answers where the settings say; a site that only polls PLCs has none."""
    place = f"Modbus TCP {settings.host}:{settings.port}"
    try:
        async with asyncio.timeout(MODBUS_S):
            reader, writer = await asyncio.open_connection(settings.host, settings.port)
            try:
                writer.write(bytes.fromhex(READ_FIRST_INPUT.format(unit=settings.unit_id)))
                head = await reader.readexactly(8)
            finally:
                writer.close()
    except (OSError, TimeoutError, asyncio.IncompleteReadError) as error:
        reason = "no answer" if isinstance(error, TimeoutError | asyncio.IncompleteReadError) else "cannot connect"
        return Finding("modbus", "warning", f"{place}: {reason}", "needed only where this site serves Modbus itself")
    if head[7] != 4:
        advice = "is modbus.unit_id the one of the server?"
        return Finding(
            "modbus", "warning", f"{place}: answers with an exception to unit id {settings.unit_id}", advice
        )
    return Finding("modbus", "ok", f"{place} answers")
