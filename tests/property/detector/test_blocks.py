"""A recording taken in blocks and sample by sample: the same verdicts to the byte, and the same state after them."""

import numpy as np
import pytest

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.stream.block import Block, blocks
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.faults.pump.blockage import Blockage
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

HOURS = 9
BLOCKED = Scenario(name="blocked", fault=(Blockage(pump=2, speed_loss=0.3, start_s=24_000, end_s=29_000),))


def stations():
    alpha = find_station("alpha")
    common = alpha.rising_main.model_copy(update={"layout": "common"})
    return {"alpha": alpha, "common": alpha.model_copy(update={"rising_main": common})}


@pytest.fixture(scope="module")
def recordings():
    """Recordings by name of station and scenario."""
    scenarios = {"paper": find_scenario("paper"), "blocked": BLOCKED}
    return {
        (name, kind): Simulation(station, scenario, 7).advance(HOURS * 3600, truth=False)
        for name, station in stations().items()
        for kind, scenario in scenarios.items()
    }


def spoilt(recording, rng):
    """The recording with values absent, out of range or stuck, and with rows lost, doubled, late, mixed up."""
    rows, columns = len(recording), {name: values.copy() for name, values in recording.columns.items()}
    names = list(columns)
    for _ in range(30):
        first, length = int(rng.integers(rows)), int(rng.integers(1, 900))
        name = names[int(rng.integers(len(names)))]
        stuck = columns[name][first]
        columns[name][first : first + length] = rng.choice([np.nan, np.inf, 1e9, -1e9, 0.0, stuck, stuck])
    lost = np.zeros(rows, dtype=bool)
    for _ in range(8):
        first = int(rng.integers(rows))
        lost[first : first + int(rng.integers(2, 300))] = True
    order = []
    for row in np.flatnonzero(~lost).tolist():
        order += [row] * (2 if rng.random() < 0.01 else 1)
        if rng.random() < 0.01:
            order.append(max(row - int(rng.integers(1, 200)), 0))
    index = np.array(order)
    for first in rng.integers(len(index) - 40, size=3).tolist():
        index[first : first + 40] = rng.permutation(index[first : first + 40])
    time_ns = recording.time_ns[index] + rng.integers(0, 1000, size=len(index)) * 1000
    for first in rng.integers(len(index), size=2).tolist():
        time_ns[first:] += int(rng.integers(-4000, 4000)) * NS_PER_S
    time_ns[rng.integers(len(index), size=4)] = rng.integers(-(2**62), 2**62, size=4)
    dropped = {str(name) for name in rng.choice(names, size=int(rng.integers(0, 3)), replace=False)}
    return Recording(
        time_ns=time_ns, columns={name: values[index] for name, values in columns.items() if name not in dropped}
    )


def live(recording, pumps):
    """Blocks of a recording as if nobody knew which rows come next."""
    for block in blocks(recording, pumps):
        yield block._replace(is_confirmed=np.zeros_like(block.is_confirmed))


def cut(block, rng):
    """The block in pieces of any length, some of them of one sample."""
    first = 0
    while first < len(block.time_ns):
        last = first + int(rng.choice([1, 2, 100, 3000]))
        yield Block(*(values[first:last] for values in block[:5]), *block[5:])
        first = last


@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(seed, marks=pytest.mark.long) for seed in range(4, 12))])
@pytest.mark.parametrize("kind", ["paper", "blocked"])
@pytest.mark.parametrize("layout", ["alpha", "common"])
def test_blocks_give_the_verdicts_and_the_state_of_single_samples(recordings, layout, kind, seed):
    rng, recording = np.random.default_rng(seed), recordings[layout, kind]
    if seed:  # the first is left whole
        recording = spoilt(recording, rng)
    station = stations()[layout]
    one_by_one, in_blocks = (Detector(station.name, datasheet_of(station)) for _ in range(2))
    expected = [verdict.encode() for row in recording.rows() for verdict in one_by_one.update(row)]
    pieces = (piece for block in live(recording, len(station.pump)) for piece in cut(block, rng))
    assert [verdict.encode() for piece in pieces for verdict in in_blocks.update_block(piece)] == expected
    assert len(expected) > 25
    assert in_blocks.counts == one_by_one.counts
    assert in_blocks.snapshot() == one_by_one.snapshot()
    assert [v.encode() for v in in_blocks.finish()] == [v.encode() for v in one_by_one.finish()]


@pytest.mark.parametrize("every", [1, 5, 20, 60])
def test_slow_feeds_and_pumps_without_head_are_taken_alike(recordings, every):
    recording, station = recordings["alpha", "blocked"], stations()["alpha"]
    columns = {name: values[::every] for name, values in recording.columns.items() if name != "pump2_head_m"}
    recording = Recording(time_ns=recording.time_ns[::every], columns=columns)
    one_by_one, in_blocks = (Detector(station.name, datasheet_of(station)) for _ in range(2))
    expected = [verdict for row in recording.rows() for verdict in one_by_one.update(row)]
    pieces = (piece for block in blocks(recording, 3) for piece in cut(block, np.random.default_rng(every)))
    told = [verdict.encode() for piece in pieces for verdict in in_blocks.update_block(piece)]
    assert told == [verdict.encode() for verdict in expected]
    assert in_blocks.snapshot() == one_by_one.snapshot()
    assert {verdict.state for verdict in expected if verdict.pump == 2} >= {"unknown", "learning", "normal"}
    assert {verdict.state for verdict in expected if verdict.pump == 1} >= {"learning", "normal"}


def test_messages_give_the_verdicts_of_the_rows_that_they_were(recordings):
    recording, station = spoilt(recordings["alpha", "blocked"], np.random.default_rng(99)), stations()["alpha"]
    in_blocks, singly = (Detector(station.name, datasheet_of(station)) for _ in range(2))
    told = [verdict.encode() for block in live(recording, 3) for verdict in in_blocks.update_block(block)]
    assert [v.encode() for sample in recording.samples("alpha") for v in singly.update(sample)] == told
    assert singly.snapshot() == in_blocks.snapshot()
