"""Each process of a site is killed with -9 in turn, the router too: nothing is lost or told otherwise."""

import asyncio
import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from ports import free_port

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.protocols.bus.keys import SITE, alive_key, plant_clock_key
from wetwell.protocols.bus.zenoh.link import connect_client
from wetwell.protocols.messages.plant_clock import PlantClockOrder
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.timestamps import MAX_STAMP_NS
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.runtime.client import first_answer

pytestmark = pytest.mark.check

SPEED = 15
"""Seconds of the station in one on the wall."""
FAST = 600
"""As the demo runs: a process that is away for ten seconds misses 6,000 samples."""
ROUNDS = 3
LIMIT_S = 180.0
VICTIMS = ("detector", "historian", "alarms", "router")


class Site:
    """Processes of a site that can be killed and started again."""

    def __init__(self, folder: Path, speed: int = SPEED) -> None:
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        self.folder = folder
        self._log = folder / "log"
        self._commands = {
            "router": ["router"],
            "historian": ["historian", "--data", str(folder / "history")],
            "detector": ["detector"],
            "alarms": ["alarms"],
            "simulator": ["simulator", "--speed", str(speed), "--seed", "3"],
        }
        self._environment = os.environ | {
            "WETWELL_DETECTOR__STATE_DIR": str(folder / "detector"),
            "WETWELL_DETECTOR__CHECKPOINT_S": "1",
            "WETWELL_ALARMS__STATE_DIR": str(folder / "alarms"),
        }
        self.running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str) -> None:
        """Start a process."""
        command = [sys.executable, "-m", "wetwell.services", *self._commands[name], "--zenoh", self.endpoint]
        with self._log.open("ab") as log:
            self.running[name] = subprocess.Popen(command, stdout=log, stderr=log, env=self._environment)

    def stop(self, name: str, sig: signal.Signals) -> int:
        """End a process and return its exit code."""
        process = self.running.pop(name)
        process.send_signal(sig)
        return process.wait(LIMIT_S)

    async def all_there(self) -> None:
        """Wait until all that take samples have shown themselves."""
        missing = {alive_key("alpha", "detector"), alive_key(SITE, "historian"), alive_key(SITE, "alarms")}
        async with asyncio.timeout(LIMIT_S):
            with await connect_client(self.endpoint) as bus:
                watch = bus.watch(alive_key("*", "*"))
                while missing:
                    missing -= {presence.key for presence in await watch.receive()}

    def kept(self) -> int:
        """Number of samples that the historian has kept."""
        try:
            store = FolderStore(self.folder / "history", keep_live_days=1)
        except Exception:  # noqa: BLE001 -- it is just being made
            return 0
        with contextlib.closing(store):
            return len(store.samples("alpha", 0, MAX_STAMP_NS))

    def end_in_order(self) -> None:
        """Hold the plant, let what is on its way arrive, and stop all."""
        asyncio.run(self._hold())
        quiet = -1
        while quiet != (quiet := self.kept()):
            time.sleep(5.0)
        names = ("simulator", "detector", "alarms", "historian", "router")
        assert [self.stop(name, signal.SIGTERM) for name in names] == [0] * len(names)

    async def _hold(self) -> None:
        order = PlantClockOrder(is_held=True).encode()
        with await connect_client(self.endpoint) as bus:
            await asyncio.wait_for(first_answer(bus, plant_clock_key("alpha"), order, timeout_s=5.0), LIMIT_S)

    def wait_for(self, samples: int) -> None:
        """Wait until so many samples are kept."""
        end = time.monotonic() + LIMIT_S
        while (kept := self.kept()) < samples:
            assert time.monotonic() < end, f"{kept} samples of {samples} after {LIMIT_S:g} s; see {self._log}"
            time.sleep(0.1)  # real processes: there is no virtual time here


@contextlib.contextmanager
def site(folder: Path, speed: int = SPEED) -> Iterator[Site]:
    it = Site(folder, speed)
    try:
        yield it
    finally:
        for process in it.running.values():
            process.kill()
            process.wait()


def undisturbed(alpha, folder: Path) -> tuple[list[int], set[bytes], list[bytes]]:
    """Numbers of the kept samples, verdicts of a detector that was never disturbed, verdicts that were kept."""
    with contextlib.closing(FolderStore(folder / "history", keep_live_days=1)) as store:
        kept = store.samples("alpha", 0, MAX_STAMP_NS)
        verdicts = store.events("verdicts", "alpha", 0, MAX_STAMP_NS, 1_000_000)
    samples = [
        Sample.model_validate(sample.model_dump() | {"seq": seq})
        for sample, seq in zip(kept.recording().samples("alpha"), kept.seq.tolist(), strict=True)
    ]
    detector = Detector("alpha", datasheet_of(alpha))
    wanted = {verdict.encode() for sample in samples for verdict in detector.update(sample)}
    return kept.seq.tolist(), wanted, verdicts


def test_nothing_is_lost_or_told_otherwise_when_each_process_is_killed_in_turn(alpha, tmp_path):
    with site(tmp_path) as it:
        for name in ("router", "historian", "detector", "alarms"):
            it.start(name)
        asyncio.run(it.all_there())
        it.start("simulator")
        samples = 10 * SPEED
        it.wait_for(samples)
        for victim in VICTIMS:
            assert it.stop(victim, signal.SIGKILL) == -signal.SIGKILL
            it.start(victim)
            samples = it.kept() + 8 * SPEED
            it.wait_for(samples)
        ended = it.kept() + 4 * SPEED
        it.wait_for(ended)
        it.end_in_order()
    assert_as_undisturbed(alpha, tmp_path)


@pytest.mark.soak
@pytest.mark.timeout(900)
def test_nor_when_detector_and_historian_are_killed_together_at_600_times_life(alpha, tmp_path):
    """The gap of both is in what the simulator keeps; the detector's is asked of a historian that starts too."""
    with site(tmp_path, FAST) as it:
        for name in ("router", "historian", "detector", "alarms"):
            it.start(name)
        asyncio.run(it.all_there())
        it.start("simulator")
        it.wait_for(10 * FAST)
        for number in range(ROUNDS):
            pair = ("detector", "historian")[:: 1 if number % 2 else -1]
            for victim in pair:
                it.running[victim].kill()
            for victim in pair:
                assert it.stop(victim, signal.SIGKILL) == -signal.SIGKILL
            for victim in pair:
                it.start(victim)
            it.wait_for(it.kept() + 10 * FAST)
        it.end_in_order()
    assert_as_undisturbed(alpha, tmp_path)


def assert_as_undisturbed(alpha, folder):
    seqs, wanted, verdicts = undisturbed(alpha, folder)
    assert seqs == list(range(len(seqs)))
    assert len(verdicts) == len(set(verdicts))
    told = {Verdict.decode(verdict).model_dump_json() for verdict in verdicts}
    assert told == {Verdict.decode(verdict).model_dump_json() for verdict in wanted}
