"""The learning phase: how long it takes, what it refuses, and when it gives in."""

import numpy as np
import pytest
from judging import verdicts_on

from wetwell.detector.baseline.learning import DAY_S, Learning, sibling_rejection, stationarity_rejection
from wetwell.detector.baseline.model import MIN_RUNS
from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.curves.sensor_signatures import flow_meter_direction
from wetwell.detector.detector import Detector
from wetwell.protocols.timestamps import LEARNING_S, NS_PER_S
from wetwell.services.stations import find_scenario
from wetwell.simulator.simulation import Simulation

EVERY_S = 900.0
CURVE = (36.0, -0.02333, -1.3333e-4)
FRICTION_H2_M5 = 6.0e-4
PER_GAIN_M = flow_meter_direction(200.0, 200.0, 200.0, CURVE, FRICTION_H2_M5)


@pytest.fixture(scope="session")
def healthy_run(segments_of):
    """Function that makes a run at the paper's noise, with its residuals moved by so much."""

    def made(rng, *, pump_m=0.0, system_m=0.0, segments=10):
        residual_m = np.array([pump_m, system_m]) + rng.normal(size=(segments, 2)) * [0.06, 0.1]
        return segments_of(residual_m, flow_m3h=200.0 + rng.normal(0.0, 0.4, segments))

    return made


@pytest.fixture(scope="session")
def learnt(healthy_run):
    """Function that learns from a run each quarter of an hour; `shift(end_s)` moves (pump, system) residuals."""

    def made(shift, *, until_s, seed=0):
        learning, rng = Learning(), np.random.default_rng(seed)
        for end_s in np.arange(EVERY_S, until_s + 1.0, EVERY_S):
            pump_m, system_m = shift(end_s)
            learning.add(healthy_run(rng, pump_m=pump_m, system_m=system_m), end_s)
        return learning

    return made


def baseline_of(learning, seen_s):
    return learning.baseline(seen_s, CURVE, FRICTION_H2_M5)


def healthy(_end_s):
    return 0.5, -0.3


@pytest.mark.parametrize("seed", range(5))
def test_learning_ends_after_six_hours_and_not_before(learnt, seed):
    learning = learnt(healthy, until_s=LEARNING_S, seed=seed)
    assert baseline_of(learning, LEARNING_S - 1.0) is None
    assert learning.reason == "6.0 of 6 h"
    baseline, runs = baseline_of(learning, LEARNING_S)
    assert len(runs) == LEARNING_S / EVERY_S
    np.testing.assert_allclose(baseline.offset_m, [0.5, -0.3], atol=0.05)
    assert learning.reason == ""


def test_learning_needs_runs_and_says_so(healthy_run):
    learning, rng = Learning(), np.random.default_rng(0)
    for n in range(MIN_RUNS - 1):
        learning.add(healthy_run(rng), EVERY_S * (n + 1))
        learning.add(healthy_run(rng, segments=1), EVERY_S * (n + 1))
    assert baseline_of(learning, LEARNING_S) is None
    assert learning.reason == "3 of 4 usable runs"


@pytest.mark.parametrize(("column", "curve"), [(0, "pump"), (1, "system")])
@pytest.mark.parametrize(
    "disturbance",
    [
        lambda end_s: 1.5 * end_s / LEARNING_S,
        lambda end_s: 1.0 if end_s > 0.5 * LEARNING_S else 0.0,
        lambda end_s: 0.5 if end_s > 0.9 * LEARNING_S else 0.0,
        lambda end_s: -0.5 if end_s < 0.1 * LEARNING_S else 0.0,
    ],
    ids=["drift", "step", "late step", "early step"],
)
def test_a_disturbance_within_the_window_is_refused_with_its_curve(learnt, column, curve, disturbance):
    def moved(end_s):
        return tuple(disturbance(end_s) * np.eye(2)[column])

    learning = learnt(moved, until_s=LEARNING_S)
    assert baseline_of(learning, LEARNING_S) is None
    assert learning.reason.startswith(f"the {curve} curve moved by ")
    assert learning.reason.endswith(" m while it was learnt")


def test_learning_ends_once_a_disturbance_has_left_the_window(healthy_run):
    def moved(end_s):
        return (-3.0 if 3_000.0 < end_s < 9_000.0 else 0.0), 0.0

    learning, rng, ended_s = Learning(), np.random.default_rng(0), None
    for end_s in np.arange(EVERY_S, 3 * LEARNING_S, EVERY_S):
        learning.add(healthy_run(rng, pump_m=moved(end_s)[0]), end_s)
        found = baseline_of(learning, end_s) if ended_s is None else None
        if found is not None:
            ended_s, offset_m = end_s, found[0].offset_m
    assert 9_000.0 + LEARNING_S - EVERY_S <= ended_s <= 9_000.0 + LEARNING_S + EVERY_S
    np.testing.assert_allclose(offset_m, 0.0, atol=0.05)


def wander(end_s, share):
    """What a flow meter that wanders by this share over the day does to (r_p, r_s)."""
    return share * np.sin(2.0 * np.pi * end_s / DAY_S) * PER_GAIN_M


def test_a_flow_meter_that_wanders_over_the_day_takes_a_day_to_learn(learnt):
    learning = learnt(lambda end_s: wander(end_s, 0.01), until_s=DAY_S)
    assert baseline_of(learning, LEARNING_S) is None
    found = baseline_of(learning, DAY_S)
    baseline, runs = found
    assert len(runs) == DAY_S / EVERY_S
    np.testing.assert_allclose(baseline.offset_m, 0.0, atol=0.1)
    told = np.sqrt(np.diag(baseline.run_covariance))
    np.testing.assert_allclose(told, np.abs(0.01 / np.sqrt(2.0) * PER_GAIN_M), rtol=0.4)


def test_the_wandering_is_noticed_after_six_hours_and_said(learnt):
    learning = learnt(lambda end_s: wander(end_s, 0.01), until_s=LEARNING_S)
    assert baseline_of(learning, LEARNING_S) is None
    assert baseline_of(learning, LEARNING_S + 60.0) is None
    assert learning.reason == "the flow meter seems to wander: 6.0 of 24 h"


def test_a_flow_meter_that_wanders_too_much_is_never_learnt(learnt):
    learning = learnt(lambda end_s: wander(end_s, 0.05), until_s=2.0 * DAY_S)
    assert all(baseline_of(learning, seen_s) is None for seen_s in np.arange(LEARNING_S, 2.0 * DAY_S, 4.0 * EVERY_S))


@pytest.mark.parametrize("column", [0, 1])
def test_a_curve_that_wanders_over_the_day_is_not_taken_for_a_flow_meter(learnt, column):
    learning = learnt(
        lambda end_s: np.eye(2)[column] * 0.5 * np.sin(2.0 * np.pi * end_s / DAY_S), until_s=1.5 * DAY_S
    )
    assert all(baseline_of(learning, seen_s) is None for seen_s in np.arange(DAY_S, 1.5 * DAY_S, EVERY_S))


def test_only_a_day_of_runs_is_kept(learnt):
    learning = learnt(healthy, until_s=3.0 * DAY_S)
    assert len(learning.runs(3.0 * DAY_S, np.inf)) == DAY_S / EVERY_S + 1
    assert len(learning.runs(9.0 * DAY_S, LEARNING_S)) == MIN_RUNS, "always so many, however old they are"
    assert learning.offset_m == pytest.approx(0.5, abs=0.05)
    assert Learning().offset_m is None


def test_an_objection_looks_at_deviations_and_not_at_residuals(learnt):
    learning = learnt(lambda end_s: (0.0, 5.0 * end_s / LEARNING_S), until_s=LEARNING_S)
    runs = learning.runs(LEARNING_S, LEARNING_S)
    baseline = baseline_of(learnt(healthy, until_s=LEARNING_S), LEARNING_S)[0]
    assert stationarity_rejection(np.zeros((len(runs), 2)), baseline, runs, CURVE[0]) is None
    rising = np.column_stack([np.zeros(len(runs)), np.linspace(0.0, 5.0, len(runs))])
    assert stationarity_rejection(rising, baseline, runs, CURVE[0]).startswith("the system curve moved by +2.")


@pytest.mark.parametrize("gap_m", [-3.75, 3.85])
def test_a_pump_that_differs_from_its_siblings_is_refused(gap_m):
    message = sibling_rejection(0, [gap_m, 0.0, 0.1], [CURVE] * 3)
    assert message.startswith(f"its curve lies {gap_m - 0.05:+.1f} m from that of its siblings")
    assert sibling_rejection(1, [gap_m, 0.0, 0.1], [CURVE] * 3) is None


def test_only_pumps_of_the_same_curve_that_are_known_are_siblings():
    other = (40.0, 0.0, -2e-4)
    assert sibling_rejection(0, [-9.0, 0.0], [CURVE, other]) is None
    assert sibling_rejection(0, [-9.0, None], [CURVE, CURVE]) is None
    assert sibling_rejection(0, [None, 0.0], [CURVE, CURVE]) is None
    assert sibling_rejection(0, [-3.5, 0.0], [CURVE, CURVE]) is None


def test_the_papers_blockage_within_learning_is_never_learnt(alpha):
    recording = Simulation(alpha, find_scenario("blockage"), 0).advance(55_000)
    start_ns = int(recording.time_ns[0])
    detector = Detector(alpha.name, datasheet_of(alpha))
    verdicts = verdicts_on(detector, recording)
    first_judged_s = {}
    for verdict in verdicts:
        if verdict.state != "learning":
            first_judged_s.setdefault(verdict.pump, (verdict.time - start_ns) / NS_PER_S)
    assert set(first_judged_s) == {1, 2, 3}
    assert min(first_judged_s.values()) >= LEARNING_S
    assert max(first_judged_s[2], first_judged_s[3]) < LEARNING_S + 5_000.0
    assert first_judged_s[1] > 36_000.0
    told = [verdict.state for verdict in verdicts if verdict.state != "learning"]
    assert set(told) <= {"normal", "unknown"}
    assert told.count("unknown") <= 0.01 * len(told)
    assert any("the pump curve moved by" in verdict.evidence.get("reason", "") for verdict in verdicts)
