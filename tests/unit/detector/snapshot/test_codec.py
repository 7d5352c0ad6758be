"""Snapshots of the detector: exact at any sample, versioned, refused when damaged."""

import hashlib
import json
import re

import pytest

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.snapshot.codec import SCHEMA, SnapshotError
from wetwell.simulator.faults.pump.blockage import Blockage
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

SCENARIO = Scenario(name="short", fault=(Blockage(pump=2, speed_loss=0.3, start_s=24_000, end_s=28_000),))
SECONDS = 30_000


@pytest.fixture(scope="module")
def samples(alpha):
    recording = Simulation(alpha, SCENARIO, 5).advance(SECONDS)
    return list(recording.samples(alpha.name))


@pytest.fixture(scope="module")
def uninterrupted(alpha, samples):
    """Verdicts of a run without a break, by the number of the sample that brought them; and snapshots on the way."""
    detector = Detector(alpha.name, datasheet_of(alpha))
    verdicts, snapshots = [], {}
    for number, sample in enumerate(samples):
        if number in {0, 1, 4_321, 21_599, 23_456, 26_123, 28_900}:
            snapshots[number] = detector.snapshot()
        verdicts += [(number, verdict) for verdict in detector.update(sample)]
    return verdicts, snapshots


def test_a_restored_detector_goes_on_bit_for_bit(alpha, samples, uninterrupted):
    verdicts, snapshots = uninterrupted
    for begin, data in snapshots.items():
        detector = Detector(alpha.name, datasheet_of(alpha))
        detector.restore(data)
        assert detector.snapshot() == data
        told = [(number, verdict) for number in range(begin, SECONDS) for verdict in detector.update(samples[number])]
        expected = [(number, verdict) for number, verdict in verdicts if number >= begin]
        assert [(n, v.encode()) for n, v in told] == [(n, v.encode()) for n, v in expected], begin
    assert {verdict.state for _, verdict in verdicts} >= {"learning", "normal", "pump_fault"}


def resealed(header: dict[str, object], text: str) -> bytes:
    body = text.encode()
    return json.dumps(header | {"sha256": hashlib.sha256(body).hexdigest()}).encode() + b"\n" + body


def damaged(data: bytes) -> dict[str, bytes]:
    head, body = data.split(b"\n", 1)
    header, state = json.loads(head), json.loads(body)
    fewer = {"dict": [[key, part[:-1] if key == "pumps" else part] for key, part in state["dict"]]}
    return {
        "2 pumps, the station has 3": resealed(header, json.dumps(fewer)),
        "'(,)f8' is no type of an array": resealed(header, json.dumps(state).replace('"<f8"', '"(,)f8"')),
        "damaged, its first line is no header": data[100:],
        "damaged, its checksum differs": data[:-20],
        "format 'wetwell.detector-snapshot/9'": json.dumps(header | {"schema": SCHEMA[:-1] + "9"}).encode()
        + b"\n"
        + body,
        "this is station 'alpha'": json.dumps(header | {"station": "other"}).encode() + b"\n" + body,
    }


def test_a_damaged_snapshot_is_refused_and_changes_nothing(alpha, uninterrupted):
    data = uninterrupted[1][26_123]
    for said, bad in damaged(data).items():
        detector = Detector(alpha.name, datasheet_of(alpha))
        before = detector.snapshot()
        with pytest.raises(SnapshotError, match=re.escape(said)):
            detector.restore(bad)
        assert detector.snapshot() == before
    steeper = alpha.model_copy(update={"rising_main": alpha.rising_main.model_copy(update={"friction_h2_m5": 7e-4})})
    with pytest.raises(SnapshotError, match="the curves in the station file have changed since"):
        Detector(alpha.name, datasheet_of(steeper)).restore(data)


def test_a_snapshot_stays_small(uninterrupted):
    assert max(len(data) for data in uninterrupted[1].values()) < 600_000
