"""Snapshots that older versions have written: what was learnt goes on.

`tests/data/detector-1.snapshot.gz` was written by commit 1ebacc3 after 40 452 s of station alpha, scenario paper,
seed 7; pump 2 was re-baselined after 36 001 s, and a run of pump 1 was open.
"""

import gzip
import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.snapshot.codec import FORM, SCHEMA
from wetwell.detector.snapshot.upgrades import UPGRADES
from wetwell.detector.stream.block import Block, blocks
from wetwell.services.stations import find_scenario
from wetwell.simulator.simulation import Simulation

DATA = Path(__file__).parents[3] / "data"
SEEN = 40_452


@pytest.fixture(scope="module")
def data():
    return gzip.decompress((DATA / "detector-1.snapshot.gz").read_bytes())


@pytest.fixture
def upgraded(alpha, data):
    detector = Detector(alpha.name, datasheet_of(alpha))
    detector.restore(data)
    return detector


def stored_pumps(data):
    """Fields of the pumps, as they stand in the file."""
    state = dict(json.loads(data.split(b"\n")[1])["dict"])
    return [pump["object"][1] for pump in state["_pumps"]]


def rest(alpha):
    """The samples of the next two hours."""
    recording = Simulation(alpha, find_scenario("paper"), 7).advance(SEEN + 7200, truth=False)
    for block in blocks(recording, len(alpha.pump)):
        is_new = block.seq >= SEEN
        yield Block(*(column[is_new] for column in block[:5]), *block[5:])


def without_steps(snapshot):
    """A snapshot as the same form had it before the usual step was learnt."""
    head, body = snapshot.strip().split(b"\n")
    state = json.loads(body)
    arrays = dict(state["dict"])["arrays"]["dict"]
    arrays[:] = [item for item in arrays if item[0] != "sampling_steps"]
    text = json.dumps(state, separators=(",", ":"))
    header = json.loads(head) | {"sha256": hashlib.sha256(text.encode()).hexdigest()}
    return f"{json.dumps(header)}\n{text}\n".encode()


def test_a_snapshot_without_the_usual_step_says_what_one_with_it_says(alpha):
    blocks_of_hours = list(blocks(Simulation(alpha, find_scenario("paper"), 7).advance(14 * 3600, truth=False), 3))
    half = len(blocks_of_hours) // 2
    whole, older = (Detector(alpha.name, datasheet_of(alpha)) for _ in range(2))
    for block in blocks_of_hours[:half]:
        whole.update_block(block)
    older.restore(without_steps(whole.snapshot()))
    told = [[detector.update_block(block) for block in blocks_of_hours[half:]] for detector in (whole, older)]
    assert told[0] == told[1]
    assert any(verdict.state == "normal" for verdicts in told[0] for verdict in verdicts)
    assert whole.snapshot() == older.snapshot()


def test_each_form_has_its_upgrade():
    assert sorted(UPGRADES) == list(range(1, FORM))


def test_what_was_learnt_is_taken_over(data, upgraded):
    assert data.startswith(b'{"schema": "wetwell.detector-snapshot/1"')
    assert upgraded.counts == {"samples": SEEN}
    assert upgraded.seen_until_ns == 1_735_730_051 * 10**9
    stored = stored_pumps(data)
    assert [pump["known"] is None for pump in stored] == [False, True, False]
    for baseline, pump in zip(upgraded.baselines, stored, strict=True):
        if pump["known"] is None:
            assert baseline is None
            continue
        fields = pump["known"]["object"][1]["baseline"]["object"][1]
        assert baseline.flow_scatter == fields["flow_scatter"]
        assert baseline.level_m == fields["level_m"]
        assert baseline.segment_samples == 25


def test_it_goes_on_without_learning_again(alpha, upgraded):
    verdicts = [verdict for block in rest(alpha) for verdict in upgraded.update_block(block)]
    assert {verdict.pump for verdict in verdicts} == {1, 2, 3}
    assert all(verdict.evidence.get("reason") != "begins" for verdict in verdicts)
    assert all((verdict.state == "learning") is (verdict.pump == 2) for verdict in verdicts)
    assert all(verdict.evidence["baseline"] == 1 for verdict in verdicts if verdict.pump != 2)
    learnt_h = [float(verdict.evidence["reason"].split()[0]) for verdict in verdicts if verdict.pump == 2]
    assert learnt_h[0] > (SEEN - 36_001) / 3600.0 - 0.1, "the hours that it has learnt count"
    assert upgraded.counts == {"samples": SEEN + 7200}


def test_a_fault_that_was_told_stands(alpha, data, upgraded):
    assert [pump["state"] for pump in stored_pumps(data)] == ["pump_fault", "learning", "normal"]
    first = next(verdict for block in rest(alpha) for verdict in upgraded.update_block(block) if verdict.pump == 1)
    assert first.state == "pump_fault"
    assert first.onset == stored_pumps(data)[0]["onset_ns"]


def test_the_baseline_that_was_put_aside_can_be_taken_back(upgraded):
    told = upgraded.revert(1, upgraded.seen_until_ns)
    assert told.evidence == {"reason": "baseline taken back by an operator", "baseline": 1}
    assert upgraded.baselines[1] is not None


def test_it_is_kept_in_the_new_form(alpha, upgraded):
    kept = upgraded.snapshot()
    assert json.loads(kept.split(b"\n")[0])["schema"] == SCHEMA
    again = Detector(alpha.name, datasheet_of(alpha))
    again.restore(kept)
    assert again.snapshot() == kept


def test_how_long_readings_repeated_themselves_is_taken_over(data, upgraded):
    state = dict(json.loads(data.split(b"\n")[1])["dict"])
    stored = dict(state["_repeats"]["object"][1]["longest_ns"]["dict"])
    assert sorted(np.unique(upgraded._runs.state.stuck_sensors["longest_ns"]).tolist()) == sorted(
        {0, *stored.values()}
    )
