"""Every detector of the register on a short recording with a blocked pump: what each can and cannot see."""

import importlib.util

import numpy as np
import pytest

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.evaluation.methods import DETECTORS, detector_class
from wetwell.detector.stream.block import blocks
from wetwell.protocols.errors import ConfigError
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.batch.backtest import detectors_named, verdicts_on
from wetwell.simulator.faults.pump.blockage import Blockage
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

SECONDS = 9 * 3600
PUMP_2_BLOCKED = Scenario(
    name="short", fault=(Blockage(pump=2, speed_loss=0.4, start_s=24_000, end_s=30_000, after="hold"),)
)
HAS_RIVER = importlib.util.find_spec("river") is not None
INSTALLED = [name for name in DETECTORS if HAS_RIVER or not name.startswith("river")]
NAMES = [
    pytest.param(name, marks=pytest.mark.skipif(name not in INSTALLED, reason="river is not installed"))
    for name in DETECTORS
]
SEES_LEVELS = {
    "wetwell",
    "paper_f_shift",
    "paper_tangent_segments",
    "cusum_statsmodels",
    "river_adwin",
    "river_page_hinkley",
}


@pytest.fixture(scope="module")
def recording(alpha):
    return Simulation(alpha, PUMP_2_BLOCKED, 3).advance(SECONDS)


@pytest.fixture(scope="module")
def told(alpha, recording):
    return {
        name: verdicts for name, (verdicts, _) in verdicts_on(recording, alpha, detectors_named(INSTALLED)).items()
    }


@pytest.mark.parametrize("name", NAMES)
def test_one_verdict_a_run_learning_first_then_what_the_method_can_see(name, recording, told):
    runs = [verdict for verdict in told[name] if not verdict.evidence.get("early")]
    assert {verdict.pump for verdict in runs} == {1, 2, 3}
    end_ns = recording.time_ns[0] + 6 * 3600 * NS_PER_S
    for verdict in runs:
        assert (verdict.state == "learning") == (verdict.time <= end_ns), name
    last = {verdict.pump: verdict.state for verdict in runs if verdict.state != "unknown"}
    assert (last[2] == "pump_fault") is (name in SEES_LEVELS)


def test_all_judge_the_same_runs(told):
    windows = {
        name: sorted((verdict.pump, *verdict.window) for verdict in verdicts if verdict.window[0] < verdict.window[1])
        for name, verdicts in told.items()
        if name != "wetwell"
    }
    ours = {
        (verdict.pump, *verdict.window) for verdict in told["wetwell"][3:] if not verdict.evidence.get("early", False)
    }
    for name, theirs in windows.items():
        assert set(theirs) == ours, name


def test_a_feed_without_head_is_unknown(alpha, recording):
    blind = {column: values[:4000] for column, values in recording.columns.items() if not column.endswith("head_m")}
    short = type(recording)(time_ns=recording.time_ns[:4000], columns=blind)
    for name, (verdicts, _) in verdicts_on(short, alpha, detectors_named(INSTALLED)).items():
        told = {verdict.state for verdict in verdicts}
        assert told <= {"learning", "unknown"}, name
        assert "unknown" in told, name


def test_permuted_truth_changes_no_verdict(alpha, recording, told):
    order = np.random.default_rng(1).permutation(len(recording))
    lying = type(recording)(
        time_ns=recording.time_ns,
        columns=recording.columns,
        truth={column: values[order] for column, values in recording.truth.items()},
    )
    for name, (verdicts, _) in verdicts_on(lying, alpha, detectors_named(INSTALLED)).items():
        assert verdicts == told[name], name


def test_an_unknown_name_or_a_missing_package_is_said(monkeypatch):
    with pytest.raises(ConfigError, match="detector 'oracle' is none of wetwell, paper_f_test"):
        detector_class("oracle")
    monkeypatch.setitem(DETECTORS, "absent", "no_such_package.drift:Drift")
    with pytest.raises(ConfigError, match="detector 'absent' needs the package no_such_package: pip"):
        detector_class("absent")


def test_the_six_hours_are_those_of_the_stamps(alpha, recording):
    """Ten times as fast, nine hours are less than one."""
    quick_ns = recording.time_ns[0] + (recording.time_ns - recording.time_ns[0]) // 10
    quick = type(recording)(time_ns=quick_ns, columns=recording.columns)
    detector = detector_class("always_normal")(alpha.name, datasheet_of(alpha))
    states = {verdict.state for block in blocks(quick, quick.pumps) for verdict in detector.update_block(block)}
    assert states == {"learning"}
