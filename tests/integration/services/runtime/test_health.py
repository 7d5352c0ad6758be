"""Health over HTTP, JSON logs and systemd's socket, in this process and in real daemons."""

import asyncio
import contextlib
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest
from memory_bus import MemoryBus
from ports import free_port
from prometheus_client.parser import text_string_to_metric_families

from wetwell.protocols.errors import LinkError
from wetwell.protocols.messages.status import Status
from wetwell.services.runtime.health.board import HealthBoard
from wetwell.services.runtime.health.page import health_page
from wetwell.services.runtime.settings import HealthSettings
from wetwell.services.supervisor.serve import show_health
from wetwell.services.systemd.notify import notify, watched_by_systemd

UNITS = Path(__file__).parents[4] / "services" / "systemd"


class Clock:
    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


def get(address: str, path: str) -> tuple[int, str]:
    try:
        with urllib.request.urlopen(f"http://{address}{path}", timeout=5) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read().decode()


def test_each_fault_is_a_reason_and_goes_again(clock):
    board = HealthBoard(clock)
    board.report("alpha", "detector", 10.0, {"sample_age_s": 1.0, "dropped": 0.0, "disk_errors": 0.0})
    assert board.reasons(60.0) == []
    board.report("alpha", "detector", 10.0, {"sample_age_s": 61.0, "dropped": 3.0, "disk_errors": 1.0})
    assert board.reasons(60.0) == [
        "detector of 'alpha': no sample for 61 s",
        "detector of 'alpha': 1 writes to disk failed in a row",
        "detector of 'alpha': too slow, messages were dropped within the last minute",
    ]
    clock.now_s = 35.0
    assert len(board.reasons(60.0)) == 3
    clock.now_s = 36.0
    assert board.reasons(60.0)[0] == "detector of 'alpha': stands still, nothing told for 36 s"
    board.report("alpha", "detector", 10.0, {"sample_age_s": 1.0, "dropped": 3.0, "disk_errors": 0.0})
    assert board.reasons(60.0) == [
        "detector of 'alpha': too slow, messages were dropped within the last minute",
    ]
    clock.now_s = 61.0
    board.report("alpha", "detector", 10.0, {"sample_age_s": 1.0, "dropped": 3.0, "disk_errors": 0.0})
    assert board.reasons(60.0) == []


def test_the_pages_tell_the_figures_of_the_status_and_503_with_reasons(clock):
    board = HealthBoard(clock)
    with health_page(HealthSettings(http="127.0.0.1:0"), board) as address:
        assert address is not None
        assert get(address, "/healthz") == (503, '{"ok": false, "reasons": ["nothing is told yet: no router?"]}')
        board.report("alpha", "detector", 10.0, {"samples": 5.0, "odd name": 1.0})
        board.report("beta", "detector", 10.0, {"samples": 7.0})
        assert get(address, "/healthz") == (200, '{"ok": true, "reasons": []}')
        assert get(address, "/other")[0] == 404
        status, text = get(address, "/metrics")
        families = {family.name: family for family in text_string_to_metric_families(text)}
        assert status == 200
        assert families["wetwell_samples"].documentation == "Samples taken."
        assert [(sample.labels["station"], sample.value) for sample in families["wetwell_samples"].samples] == [
            ("alpha", 5.0),
            ("beta", 7.0),
        ]
        assert families["wetwell_odd_name"].samples[0].labels == {"station": "alpha", "service": "detector"}
        with pytest.raises(LinkError, match=f"health.http {address}: cannot listen: Address already in use"):  # noqa: SIM117
            with health_page(HealthSettings(http=address), board):
                pass


@contextlib.contextmanager
def systemd_socket(folder: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(str(folder / "notify"))
        receiver.settimeout(20)
        yield receiver


def words_of(receiver: socket.socket) -> list[str]:
    """What has come by now."""
    receiver.setblocking(False)
    words = []
    with contextlib.suppress(BlockingIOError):
        while True:
            words.append(receiver.recv(64).decode())
    return words


def test_the_watchdog_is_fed_by_the_event_loop_only(tmp_path, monkeypatch):
    async def serve(receiver: socket.socket) -> None:
        stop = asyncio.Event()
        async with watched_by_systemd(stop):
            await asyncio.sleep(0.12)
            first, *fed = words_of(receiver)
            assert first == "READY=1"
            assert len(fed) >= 2
            assert set(fed) == {"WATCHDOG=1"}
            time.sleep(0.2)  # noqa: ASYNC251 - a loop that hangs
            assert words_of(receiver) == []
            await asyncio.sleep(0.1)
            assert set(words_of(receiver)) == {"WATCHDOG=1"}
            stop.set()
            words: list[str] = []
            async with asyncio.timeout(10):
                while "STOPPING=1" not in words:
                    await asyncio.sleep(0.01)
                    words += words_of(receiver)

    with systemd_socket(tmp_path) as receiver:
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "100000")
        asyncio.run(serve(receiver))


def test_up_serves_the_figures_of_its_children(clock):
    async def hear() -> list[str]:
        with MemoryBus() as bus:
            statuses = bus.subscribe("wetwell/*/status/*")
            board = HealthBoard(clock)
            running = asyncio.create_task(show_health(statuses, board, 10.0, lambda _: None))
            status = Status(
                time=0, station="alpha", service="detector", state="running", figures={"sample_age_s": 99.0}
            )
            publisher = bus.publisher("wetwell/alpha/status/detector")
            publisher.put(b"no status")
            publisher.put(status.encode())
            await asyncio.sleep(0.01)
            running.cancel()
            return board.reasons(60.0)

    assert asyncio.run(hear()) == ["detector of 'alpha': no sample for 99 s"]


def test_without_systemd_or_with_a_dead_socket_nothing_happens(tmp_path, monkeypatch, caplog):
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    notify("READY=1")
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "nobody"))
    notify("READY=1")
    assert "No such file or directory" in caplog.text
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(f"\0wetwell-test-{os.getpid()}")
        receiver.settimeout(5)
        monkeypatch.setenv("NOTIFY_SOCKET", f"@wetwell-test-{os.getpid()}")
        notify("READY=1")
        assert receiver.recv(64) == b"READY=1"


@contextlib.contextmanager
def daemon(*arguments: str, **environment: str) -> Iterator[subprocess.Popen[str]]:
    common = {"WETWELL_LOG__FORM": "json", "WETWELL_HEALTH__PERIOD_S": "0.5"}
    process = subprocess.Popen(
        [sys.executable, "-m", "wetwell.services", *arguments],
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | common | environment,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def health_of(port: int, wanted: int) -> str:
    """What /healthz of a daemon says once it answers as it is wanted to."""
    end = time.monotonic() + 30
    while time.monotonic() < end:
        with contextlib.suppress(urllib.error.URLError):
            status, body = get(f"127.0.0.1:{port}", "/healthz")
            if status == wanted:
                return body
        time.sleep(0.05)  # a real process: there is no virtual time here
    pytest.fail(f"/healthz did not become {wanted}")


def stopped(process: subprocess.Popen[str]) -> list[dict[str, object]]:
    """Log of a daemon that was asked to stop."""
    process.send_signal(signal.SIGTERM)
    errors = process.communicate(timeout=20)[1]
    assert process.returncode == 0, errors
    return [json.loads(line) for line in errors.splitlines()]


def test_daemons_tell_systemd_http_and_the_log(tmp_path):
    port, page, lost = free_port(), free_port(), free_port()
    watched = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "8000000"}
    with (
        systemd_socket(tmp_path) as receiver,
        daemon(
            "router", "--zenoh", f"tcp/127.0.0.1:{port}", WETWELL_HEALTH__HTTP=f"127.0.0.1:{page}", **watched
        ) as it,
        daemon(
            "alarms", "--zenoh", f"tcp/127.0.0.1:{free_port()}", WETWELL_HEALTH__HTTP=f"127.0.0.1:{lost}"
        ) as other,
    ):
        words = [receiver.recv(64).decode() for _ in range(2)]
        assert words == ["READY=1", "WATCHDOG=1"]
        assert health_of(page, 200) == '{"ok": true, "reasons": []}'
        assert "no router?" in health_of(lost, 503)
        lines = stopped(it)
        assert stopped(other)[0]["service"] == "alarms"
        while words[-1] == "WATCHDOG=1":
            words.append(receiver.recv(64).decode())
        assert words[-1] == "STOPPING=1"
    assert (lines[0]["level"], lines[0]["service"]) == ("INFO", "router")
    assert lines[0]["message"].startswith("audit: ")
    assert lines[1]["message"] == f"router on tcp/127.0.0.1:{port}"


def test_units_are_alike_and_systemd_finds_no_fault_in_them(tmp_path):
    units = sorted(UNITS.glob("*.service"))
    assert [unit.stem for unit in units] == [
        f"wetwell-{name}" for name in ("alarms", "dashboard", "detector@", "gateway", "historian", "router", "watch")
    ]
    hardening = {unit.read_text().split("\n\n")[2] for unit in units}
    assert len(hardening) == 1
    for wanted in (
        "NoNewPrivileges=yes",
        "ProtectSystem=strict",
        "CapabilityBoundingSet=\n",
        "RestrictNamespaces=yes",
    ):
        assert wanted in next(iter(hardening))
    target = (UNITS / "wetwell.target").read_text()
    for unit in units:
        text = unit.read_text()
        name = unit.stem.removeprefix("wetwell-").rstrip("@")
        state = re.findall(r"^StateDirectory=(.*)", text, re.MULTILINE)
        assert re.findall(r"AUDIT_DIR=(.*)", text) == [f"%S/{folder}" for folder in state]
        assert len(state) == 1
        command = {"watch": "gap watch"}.get(name, name)
        assert f"ExecStart=wetwell {command}" in text
        for wanted in ("Type=notify", "WatchdogSec=60", "Restart=always", "DynamicUser=yes", "LoadCredential="):
            assert wanted in text
        assert unit.name in target or unit.stem.endswith("@")
        # systemd looks the command up in its own path, in which it need not be here.
        (tmp_path / unit.name.replace("@", "@alpha")).write_text(text.replace("ExecStart=wetwell", "ExecStart=true"))
    (tmp_path / "wetwell.target").write_text(target)
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd-analyze is not here")
    files = sorted(str(path) for path in tmp_path.iterdir())
    done = subprocess.run(["systemd-analyze", "verify", *files], capture_output=True, text=True, check=False)
    ours = [line for line in done.stderr.splitlines() if "wetwell" in line]
    assert (done.returncode, ours) == (0, [])
