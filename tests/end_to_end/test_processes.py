"""The real processes, started by the command line: a fault goes in, a verdict comes out of the bus."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from http import HTTPStatus
from pathlib import Path

import pytest
import zenoh
from ports import free_port

SCENARIO = """
name = "quick-blockage"
clock_speed = 3000

[inflow]
kind = "empirical"

[[fault]]
kind = "blockage"
pump = 3
speed_loss = 0.3
start_s = 25_200
end_s = 30_600
after = "hold"
"""

DEADLINE_S = 90.0


@contextlib.contextmanager
def wetwell(*arguments: str, gather_s: float = 0.0) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, "-m", "wetwell.services", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"WETWELL_HEALTH__PERIOD_S": "0.5", "WETWELL_ZENOH__GATHER_S": str(gather_s)},
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def stop(process: subprocess.Popen[str], sig: signal.Signals = signal.SIGTERM) -> tuple[int, str, str]:
    process.send_signal(sig)
    out, err = process.communicate(timeout=20)
    return process.returncode, out, err


@contextlib.contextmanager
def listener(port: int, key: str) -> Iterator[Iterator[zenoh.Sample]]:
    """Samples of a key as an independent Zenoh client sees them."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["tcp/127.0.0.1:{port}"]')
    config.insert_json5("connect/timeout_ms", "30000")
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config) as session:
        subscriber = session.declare_subscriber(key)
        yield iter_until(subscriber)


def iter_until(subscriber: zenoh.Subscriber) -> Iterator[zenoh.Sample]:
    end = time.monotonic() + DEADLINE_S
    while time.monotonic() < end:
        sample = subscriber.try_recv()
        if sample is None:
            time.sleep(0.01)  # a real peer in another process: there is no virtual time here
        else:
            yield sample
    pytest.fail(f"nothing more came within {DEADLINE_S:g} s")


@pytest.mark.parametrize("gather_s", [0.0, pytest.param(0.1, marks=pytest.mark.long)])
def test_blockage_is_seen_on_zenoh_and_every_daemon_stops_with_0(tmp_path: Path, gather_s: float) -> None:
    scenario = tmp_path / "quick.toml"
    scenario.write_text(SCENARIO)
    port = free_port()
    endpoint = f"tcp/127.0.0.1:{port}"
    with (
        wetwell("router", "--zenoh", endpoint) as router,
        wetwell("detector", "--zenoh", endpoint) as detector,
        listener(port, "wetwell/alpha/verdict/*") as verdicts,
        listener(port, "wetwell/alpha/samples") as blocks,
        wetwell("simulator", "--scenario", str(scenario), "--zenoh", endpoint, gather_s=gather_s) as simulator,
    ):
        if gather_s:
            block = json.loads(next(blocks).payload.to_string())
            assert block["schema"] == "wetwell.samples/1"
            assert len(block["time"]) == len(block["seq"]) == len(block["pumps"][0]["flow_m3h"]) > 1
        states: dict[int, list[str]] = {1: [], 2: [], 3: []}
        for sample in verdicts:
            assert sample.encoding == zenoh.Encoding.APPLICATION_JSON
            verdict = json.loads(sample.payload.to_string())
            assert verdict["schema"] == "wetwell.verdict/1"
            assert str(sample.key_expr) == f"wetwell/alpha/verdict/{verdict['pump']}"
            states[verdict["pump"]].append(verdict["state"])
            if verdict["state"] == "pump_fault":
                break
        assert verdict["pump"] == 3
        assert "2025-01-01T06:30:00Z" <= verdict["onset"] <= "2025-01-01T07:15:00Z"  # it begins at 06:45
        assert states[3][0] == "learning"
        assert "normal" in states[3]
        assert not {"pump_fault", "system_fault"} & {*states[1], *states[2]}
        for process in (simulator, detector, router):
            code, out, err = stop(process)
            assert code == 0, err
            assert "Traceback" not in out + err


def test_up_tells_where_to_look_serves_modbus_and_leaves_no_orphan() -> None:
    zenoh_port, modbus_port, page_port = free_port(), free_port(), free_port()
    flags = ["--zenoh", f"tcp/127.0.0.1:{zenoh_port}", "--modbus", f"127.0.0.1:{modbus_port}", "--for", "60s"]
    flags += ["--page", f"127.0.0.1:{page_port}"]
    with (
        wetwell("up", "--scenario", "nominal", "--speed", "100", *flags) as up,
        listener(zenoh_port, "wetwell/*/status/*") as statuses,
    ):
        services = set()
        for sample in statuses:
            services.add(json.loads(sample.payload.to_string())["service"])
            if services >= {"simulator", "detector", "alarms", "historian", "watch", "dashboard"}:
                break
        with socket.create_connection(("127.0.0.1", modbus_port), timeout=10) as plc:
            plc.sendall(bytes.fromhex("000100000006010400000002"))  # read level_m by function code 04
            answer = plc.recv(64)
        assert answer[7:9] == bytes([4, 4])
        assert _told(page_port, "alpha", "model")["station"] == "alpha"
        children = _children(up.pid)
        assert len(children) == 6
        code, out, err = stop(up, signal.SIGINT)
        assert code == 0, err
        assert f"mbpoll -m tcp -p {modbus_port}" in out
        assert f"http://127.0.0.1:{page_port}" in out
        assert "declare_subscriber" in out
        assert "Traceback" not in out + err
        assert not [child for child in children if Path(f"/proc/{child}").exists()]


def _told(page_port: int, station: str, key: str) -> dict[str, object]:
    """What a page says of a station under a key, as soon as it has heard of both."""
    end = time.monotonic() + DEADLINE_S
    while True:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{page_port}/api/stations/{station}", timeout=10) as page:
                if key in (said := json.load(page)):
                    return said[key]
        except urllib.error.HTTPError as error:
            if error.code != HTTPStatus.NOT_FOUND:
                raise
        assert time.monotonic() < end, f"the page says nothing under {key}"
        time.sleep(0.05)  # real processes: there is no virtual time here


def test_daemons_go_on_where_they_were_when_the_router_comes_back() -> None:
    port = free_port()
    endpoint = f"tcp/127.0.0.1:{port}"
    with (
        wetwell("detector", "--zenoh", endpoint) as detector,
        wetwell("simulator", "--zenoh", endpoint, "--speed", "50") as simulator,
    ):
        with wetwell("router", "--zenoh", endpoint) as router, listener(port, "wetwell/alpha/status/*") as statuses:
            before = _figures(statuses, "detector", least_samples=100)
            assert stop(router)[0] == 0
        with wetwell("router", "--zenoh", endpoint), listener(port, "wetwell/alpha/status/*") as statuses:
            after = _figures(statuses, "detector", least_samples=before["samples"] + 100)
        assert after.get("lost", 0) == 0, "the publisher's cache must fill the time without a router"
        for process in (simulator, detector):
            code, out, err = stop(process)
            assert code == 0, err
            assert "Traceback" not in out + err


@pytest.mark.check
@pytest.mark.parametrize(
    "file", ["anomaly-free/anomaly-free.csv.gz", pytest.param("valve1/1.csv.gz", marks=pytest.mark.long)]
)
@pytest.mark.real_data
def test_a_replayed_rig_without_head_and_frequency_gets_no_confident_fault(
    file: str, real_data: Path, tmp_path: Path
) -> None:
    recording, station, port = tmp_path / "rig.csv", tmp_path / "rig.toml", free_port()
    station.write_text('name = "rig"\nsump.area_m2 = 1.0\npump = [{curve = [20.0, 0.0, -0.1]}]\n')
    convert = ["convert", str(real_data / "skab" / file), "--out", str(recording)]
    subprocess.run([sys.executable, "-m", "wetwell.services", *convert], check=True, capture_output=True)
    common = ["--station", str(station), "--zenoh", f"tcp/127.0.0.1:{port}"]
    with (
        wetwell("router", "--zenoh", f"tcp/127.0.0.1:{port}"),
        wetwell("detector", *common) as detector,
        listener(port, "wetwell/rig/verdict/1") as verdicts,
        listener(port, "wetwell/rig/status/detector") as statuses,
    ):
        next(statuses)  # the detector is there
        with wetwell("replay", "--recording", str(recording), "--speed", "500", *common) as replay:
            rows = len(recording.read_text().splitlines()) - 1
            _figures(statuses, "detector", least_samples=0.9 * rows)
            assert replay.wait(timeout=60) == 0
        states = []
        for sample in verdicts:
            verdict = json.loads(sample.payload.to_string())
            states.append(verdict["state"])
            if verdict["state"] != "learning":
                break
        assert states == ["learning", "unknown"]
        assert verdict["evidence"]["missing"] == ["frequency_hz", "head_m", "level_m", "power_kw"]
        assert stop(detector)[0] == 0


def _figures(statuses: Iterator[zenoh.Sample], service: str, *, least_samples: float) -> dict[str, float]:
    """Health figures of a service once it has taken so many samples."""
    for sample in statuses:
        status = json.loads(sample.payload.to_string())
        if status["service"] == service and status["figures"].get("samples", 0) >= least_samples:
            return status["figures"]
    raise AssertionError("the statuses have ended")


def test_children_stop_when_the_supervisor_is_killed(tmp_path: Path) -> None:
    flags = ["--zenoh", f"tcp/127.0.0.1:{free_port()}", "--modbus", f"127.0.0.1:{free_port()}"]
    flags += ["--page", f"127.0.0.1:{free_port()}"]
    flags += ["--data", str(tmp_path)]
    with wetwell("up", *flags) as up:
        end = time.monotonic() + DEADLINE_S
        while len(children := _children(up.pid)) < 6 and time.monotonic() < end:
            time.sleep(0.05)  # real processes: there is no virtual time here
        assert len(children) == 6
        up.kill()
        while any(_is_alive(child) for child in children) and time.monotonic() < end:
            time.sleep(0.05)
        assert not [child for child in children if _is_alive(child)]


def test_a_port_in_use_is_named_and_ends_the_start() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        for arguments in (
            ["up", "--zenoh", f"tcp/127.0.0.1:{port}"],
            ["plc", "--modbus", f"127.0.0.1:{port}"],
            ["dashboard", "--page", f"127.0.0.1:{port}"],
            ["router", "--zenoh", f"tcp/127.0.0.1:{port}"],
        ):
            done = subprocess.run(
                [sys.executable, "-m", "wetwell.services", *arguments],
                capture_output=True,
                text=True,
                timeout=60,
                check=False,
            )
            assert done.returncode == 2, arguments
            last = done.stderr.strip().splitlines()[-1]
            assert last.startswith("wetwell: ")
            assert str(port) in last
            assert "Traceback" not in done.stderr


def _children(parent: int) -> list[int]:
    return [int(pid) for pid in Path(f"/proc/{parent}/task/{parent}/children").read_text().split()]


def _is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
