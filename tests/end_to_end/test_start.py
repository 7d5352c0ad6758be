"""`wetwell up` begins healthy, on a cold machine or a warm one, loaded or not: no warning, and no sample is lost."""

import contextlib
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from ports import free_port

from wetwell.protocols.timestamps import MAX_STAMP_NS
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.reports.text_table import SCREEN_WIDTH

LEAST_SAMPLES = 6_000
"""Ten seconds at 600 times life."""
PATIENCE_S = 400.0
PARTS = ("alarms", "dashboard", "detector", "historian", "simulator", "watch")
STARTS = 20
COLD = (0, 7, 14)
"""Of these starts the kernels are compiled; in the others they are loaded."""


def kept(folder: Path) -> list[int]:
    """Numbers of the samples that the historian has kept."""
    if not (folder / "live.sqlite").exists():
        return []
    with contextlib.closing(FolderStore(folder)) as store:
        return store.samples("alpha", 0, MAX_STAMP_NS).seq.tolist()


def alarms(folder: Path) -> list[bytes]:
    """What the historian has kept of alarms of the station."""
    with contextlib.closing(FolderStore(folder)) as store:
        return store.events("alarms", "alpha", 0, MAX_STAMP_NS, 10)


def start_and_stop(folder: Path, environment: dict[str, str]) -> tuple[int, str]:
    """Exit code and standard error of a site that lives until it has kept some more samples.

    The parts name themselves in one line, before any verdict is shown.
    """
    wanted = len(kept(folder)) + LEAST_SAMPLES
    flags = ["--zenoh", f"tcp/127.0.0.1:{free_port()}", "--modbus", f"127.0.0.1:{free_port()}"]
    flags += ["--page", f"127.0.0.1:{free_port()}", "--data", str(folder), "--scenario", "nominal", "--speed", "600"]
    process = subprocess.Popen(
        [sys.executable, "-m", "wetwell.services", "up", *flags],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | environment,
    )
    try:
        end = time.monotonic() + PATIENCE_S
        while len(kept(folder)) < wanted:
            assert process.poll() is None, process.communicate()[1]
            assert time.monotonic() < end, "it did not begin"
            time.sleep(0.5)  # real processes: there is no virtual time here
        process.send_signal(signal.SIGINT)
        shown, said = process.communicate(timeout=120)
        before, begins, _ = shown.partition("\nAll parts are ready")
        assert begins, shown
        assert all(f" {part} " in before.splitlines()[-1] for part in PARTS), before
        assert max(map(len, shown.splitlines())) <= SCREEN_WIDTH, shown
        assert alarms(folder) == [], "a healthy start calls nobody"
        return process.returncode, said
    finally:
        process.kill()
        process.communicate()


def burn() -> None:
    while True:
        pass


@contextlib.contextmanager
def load(processes: int) -> Iterator[None]:
    """Processes that want all the time of the machine."""
    burning = [multiprocessing.get_context("spawn").Process(target=burn, daemon=True) for _ in range(processes)]
    for process in burning:
        process.start()
    try:
        yield
    finally:
        for process in burning:
            process.kill()
            process.join()


@pytest.mark.long
@pytest.mark.timeout(900)
def test_a_start_says_nothing_and_loses_nothing_and_a_second_one_goes_on(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    assert start_and_stop(folder, {}) == (0, "")
    first = kept(folder)
    assert first == list(range(len(first)))
    assert start_and_stop(folder, {}) == (0, "")
    both = kept(folder)
    assert both == list(range(len(both)))
    assert not (tmp_path / "data-2").exists()


@pytest.mark.soak
@pytest.mark.timeout(6_000)
def test_twenty_starts_on_a_loaded_machine_cold_and_warm_are_all_healthy(tmp_path: Path) -> None:
    with load(2 * (os.cpu_count() or 1)):
        for number in range(STARTS):
            folder = tmp_path / f"start-{number}"
            cold = {"NUMBA_CACHE_DIR": str(tmp_path / f"kernels-{number}")} if number in COLD else {}
            assert start_and_stop(folder, cold) == (0, ""), number
            seqs = kept(folder)
            assert seqs == list(range(len(seqs))), number
