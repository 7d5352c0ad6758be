"""The doctor at a site of real processes in which one thing after the other is broken."""

import asyncio
import os
import subprocess
import sys
from pathlib import Path

import pytest
from ports import free_port

from wetwell.protocols.bus.keys import alarm_report_key
from wetwell.protocols.bus.zenoh.link import open_router
from wetwell.services.doctor.examine import examine
from wetwell.services.doctor.finding import Finding, exit_code

pytestmark = pytest.mark.check

LISTEN_S = 1.5


def start(*arguments: str) -> subprocess.Popen[bytes]:
    environment = os.environ | {"WETWELL_HEALTH__PERIOD_S": "0.5"}
    return subprocess.Popen([sys.executable, "-m", "wetwell.services", *arguments], env=environment)


def end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.wait()


def said(findings: list[Finding], level: str) -> list[str]:
    return [finding.text for finding in findings if finding.level == level]


def test_what_is_killed_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bus_port, modbus_port = free_port(), free_port()
    endpoint = f"tcp/127.0.0.1:{bus_port}"
    monkeypatch.setenv("WETWELL_MODBUS__PORT", str(modbus_port))
    monkeypatch.setenv("WETWELL_ALARMS__STATE_DIR", str(tmp_path))

    def look(*stations: str) -> list[Finding]:
        return asyncio.run(examine(None, endpoint, stations, LISTEN_S))

    modbus = ["--modbus", f"127.0.0.1:{modbus_port}", "--modbus-server"]
    with open_router(endpoint) as router:
        processes = {
            "simulator": start("simulator", "--zenoh", endpoint, "--speed", "1", *modbus),
            "detector": start("detector", "--zenoh", endpoint),
            "alarms": start("alarms", "--zenoh", endpoint),
        }
        try:
            asyncio.run(_until_all_is_there(router, set(processes)))
            findings = look("alpha")
            assert said(findings, "error") == []
            assert said(findings, "warning") == [
                "station 'alpha': the historian does not answer",
                "historian is not running",
                "watch is not running",
                "dashboard is not running",
            ]
            assert "station 'alpha' pump 3: learning, 0.0 h ago" in said(findings, "ok")
            well = " ".join(said(findings, "ok"))
            for part in (f"Modbus TCP 127.0.0.1:{modbus_port} answers", "alarms answers", "from this clock", "free"):
                assert part in well
            assert exit_code(findings) == 1

            end(processes["detector"])
            assert said(look("alpha"), "error") == ["station 'alpha': no detector is running"]
            end(processes["simulator"])
            findings = look("alpha")
            assert "station 'alpha': no sample within 1.5 s" in said(findings, "error")
            assert f"Modbus TCP 127.0.0.1:{modbus_port}: cannot connect" in said(findings, "warning")
            end(processes["alarms"])
            assert "alarms is not running" in said(look("alpha"), "warning")
        finally:
            for process in processes.values():
                end(process)
    findings = look(str(tmp_path / "no.toml"))
    assert said(findings, "error") == [
        f"{tmp_path / 'no.toml'}: cannot be read: No such file or directory",
        f"no router at {endpoint} within 5 s",
    ]
    assert exit_code(findings) == 2
    monkeypatch.setenv("WETWELL_MODBUS__PORT", "no port")
    (fault,) = said(look(), "error")
    assert fault.startswith("settings: modbus.port: got 'no port'")


async def _until_all_is_there(router, services: set[str]) -> None:
    """Wait until the services are announced, a sample has come and alarms answers."""
    present, samples = router.watch("wetwell/*/alive/*"), router.subscribe("wetwell/*/sample")
    async with asyncio.timeout(90):
        while services:
            services -= {presence.key.rpartition("/")[2] for presence in await present.receive()}
        await samples.receive()
        while not await router.ask(alarm_report_key(), timeout_s=1.0):
            pass
