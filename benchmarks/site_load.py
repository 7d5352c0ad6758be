"""Stations that have been learnt, and a process that plays them on the bus."""

import asyncio
import json
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.stream.block import blocks
from wetwell.protocols.bus.keys import sample_block_key, sample_key
from wetwell.protocols.bus.zenoh.link import connect_client
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.recordings.recording import Recording
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.simulation import Simulation

LEARNT_S = 28_800
"""So much of each recording is judged beforehand; the faults of scenario `demo` begin then."""
SHIFT_S = 120
"""Two stations that share a recording are so far apart in it: whole messages of up to a minute."""
RECORDINGS = 16
MOST_SHARES = 250
"""Most stations that share a recording: none ends a day."""
SCENARIOS = ("nominal", "demo")
SUMP_AREA_M2 = 2.0
"""A small wet well: about 130 runs a pump and day."""
HISTORY = 600
SETTLE_S = 5.0
TICK_S = 0.01


@dataclass(frozen=True)
class Played:
    """A station of the load: a stretch of a recording."""

    name: str
    source: Recording
    begin_s: int
    seconds: int

    @property
    def recording(self) -> Recording:
        """The stretch."""
        return part_of(self.source, self.begin_s, self.begin_s + self.seconds)


def part_of(recording: Recording, begin: int, end: int) -> Recording:
    columns = {name: values[begin:end] for name, values in recording.columns.items()}
    return replace(recording, time_ns=recording.time_ns[begin:end], columns=columns)


def prepare(folder: Path, stations: int, seconds: int) -> list[Played]:
    """Write station files and checkpoints; what each station plays."""
    model = find_station("alpha")
    small = model.model_copy(update={"sump": model.sump.model_copy(update={"area_m2": SUMP_AREA_M2})})
    text = Path(sys.modules[Simulation.__module__].__file__ or "").parent / "stations" / "alpha.toml"
    source = text.read_text().replace("area_m2 = 8.0", f"area_m2 = {SUMP_AREA_M2}")
    for name in ("stations", "state"):
        (folder / name).mkdir()
    played: list[Played] = []
    recordings = min(max(RECORDINGS, -(-stations // MOST_SHARES)), stations)
    shares = -(-stations // recordings)
    for number in range(recordings):
        length_s = LEARNT_S + SHIFT_S * shares + seconds
        simulation = Simulation(small, find_scenario(SCENARIOS[number % 2]), seed=number + 1)
        recording = simulation.advance(length_s, truth=False)
        detector, begin_s = Detector("", datasheet_of(small)), 0
        for share in range(shares):
            if (index := share * recordings + number) >= stations:
                break
            until_s = LEARNT_S + share * SHIFT_S
            for block in blocks(part_of(recording, begin_s, until_s), len(small.pump)):
                detector.update_block(block._replace(seq=block.seq + begin_s))
            begin_s, name = until_s, f"s{index:05d}"
            (folder / "stations" / f"{name}.toml").write_text(source.replace('"alpha"', f'"{name}"'))
            head, _, body = detector.snapshot().partition(b"\n")
            head = json.dumps(json.loads(head) | {"station": name}).encode()
            (folder / "state" / f"{name}.detector.json").write_bytes(head + b"\n" + body)
            played.append(Played(name, recording, begin_s, seconds))
    return sorted(played, key=lambda each: each.name)


def messages_of(each: Played, gather: int) -> list[bytes]:
    """What a station says: its samples one by one, or so many in a message."""
    samples = list(each.recording.samples(each.name, each.begin_s))
    if gather == 1:
        return [sample.encode() for sample in samples]
    return [SampleBlock.of(samples[at : at + gather]).encode() for at in range(0, len(samples), gather)]


class Said:
    """Messages of stations that share recordings: each is encoded once, and told under the name of any of them.

    Parameters
    ----------
    played : list of Played
    gather : int
        Samples in a message; `SHIFT_S` is a multiple of it where stations share a recording.
    """

    def __init__(self, played: list[Played], gather: int) -> None:
        self._gather = gather
        self._encoded: dict[int, tuple[Played, list[bytes]]] = {}
        for source in {id(each.source): each.source for each in played}.values():
            its = [each for each in played if each.source is source]
            begin_s, end_s = min(each.begin_s for each in its), max(each.begin_s + each.seconds for each in its)
            whole = replace(its[0], begin_s=begin_s, seconds=end_s - begin_s)
            self._encoded[id(source)] = whole, messages_of(whole, gather)

    def message(self, each: Played, number: int) -> bytes:
        """What a station says in its message of a number from 0."""
        whole, encoded = self._encoded[id(each.source)]
        told = encoded[(each.begin_s - whole.begin_s) // self._gather + number]
        return told.replace(f'"{whole.name}"'.encode(), f'"{each.name}"'.encode(), 1)


def play(endpoint: str, played: list[Played], accelerate: float, out: Path, gather: int = 1) -> None:
    """Publish each station at so many samples a second, `gather` in a message, spread over it; keep when."""

    async def run() -> None:
        with await connect_client(endpoint) as bus:
            key = sample_key if gather == 1 else sample_block_key
            publishers = [bus.publisher(key(each.name), history=HISTORY // gather) for each in played]
            said = Said(played, gather)
            sent_s = np.full((-(-played[0].seconds // gather), len(played)), np.nan)
            messages_a_second = accelerate / gather * len(played)
            await asyncio.sleep(SETTLE_S)
            start_s, count, late_s = time.monotonic(), 0, 0.0
            while count < sent_s.size:
                due = min(int((time.monotonic() - start_s) * messages_a_second) + 1, sent_s.size)
                while count < due:
                    number, station = divmod(count, len(played))
                    message = said.message(played[station], number)
                    sent_s[number, station] = now_s = time.monotonic()
                    publishers[station].put(message)
                    late_s = max(late_s, now_s - start_s - count / messages_a_second)
                    count += 1
                await asyncio.sleep(TICK_S)
            np.savez(out, sent_s=sent_s, late_s=late_s)
            pause_s = gather / accelerate
            await asyncio.sleep(SETTLE_S + 2.0 * pause_s)  # then who speaks in a rhythm has told which was its last

    asyncio.run(run())
