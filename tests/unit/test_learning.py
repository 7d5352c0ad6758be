"""The learning phase: how long it takes, what it refuses, and when it gives in."""

import numpy as np
import pytest

from wetwell.detector.baseline import MIN_RUNS, learn, sibling_objection
from wetwell.detector.learning import LEARNING_S, Learning
from wetwell.detector.nominal import nominal_of
from wetwell.detector.pipeline import Detector
from wetwell.detector.runs import Run
from wetwell.protocols.stamps import NS_PER_S
from wetwell.services.presets import find_scenario
from wetwell.simulator.simulation import Simulation

SHUTOFF_M = 36.0
EVERY_S = 900.0
CURVE = (36.0, -0.02333, -1.3333e-4)


def made_run(end_s, rng, *, pump_m=0.0, system_m=0.0, segments=10):
    """A healthy run at the paper's noise, with its residuals moved by so much."""
    samples = 25 * segments
    flow_m3h = 200.0 + rng.normal(size=samples)
    return Run(
        pump=0,
        window_ns=(int((end_s - samples) * NS_PER_S), int(end_s * NS_PER_S)),
        time_s=np.arange(float(samples)),
        flow_m3h=flow_m3h,
        head_m=np.full(samples, 26.0),
        speed_ratio=np.ones(samples),
        total_flow_m3h=flow_m3h,
        segments=np.array([pump_m, system_m]) + rng.normal(size=(segments, 2)) * [0.06, 0.1],
        missing=frozenset(),
    )


def learnt(shift, *, until_s, seed=0):
    """Learning after a run each quarter of an hour; `shift(end_s)` moves (pump, system) residuals."""
    learning, rng = Learning(), np.random.default_rng(seed)
    for end_s in np.arange(EVERY_S, until_s + 1.0, EVERY_S):
        pump_m, system_m = shift(end_s)
        learning.add(made_run(end_s, rng, pump_m=pump_m, system_m=system_m), end_s)
    return learning


def healthy(_end_s):
    return 0.5, -0.3


@pytest.mark.parametrize("seed", range(5))
def test_learning_ends_after_six_hours_and_not_before(seed):
    learning = learnt(healthy, until_s=LEARNING_S, seed=seed)
    assert learning.baseline(LEARNING_S - 1.0, SHUTOFF_M) is None
    assert learning.reason == "6.0 of 6 h"
    baseline = learning.baseline(LEARNING_S, SHUTOFF_M)
    assert baseline is not None
    np.testing.assert_allclose(baseline.offset_m, [0.5, -0.3], atol=0.05)
    assert learning.reason == ""


def test_learning_needs_runs_and_says_so():
    learning, rng = Learning(), np.random.default_rng(0)
    for n in range(MIN_RUNS - 1):
        learning.add(made_run(EVERY_S * (n + 1), rng), EVERY_S * (n + 1))
        learning.add(made_run(EVERY_S * (n + 1), rng, segments=1), EVERY_S * (n + 1))
    assert learning.baseline(LEARNING_S, SHUTOFF_M) is None
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
def test_a_disturbance_within_the_window_is_refused_with_its_curve(column, curve, disturbance):
    def moved(end_s):
        return tuple(disturbance(end_s) * np.eye(2)[column])

    learning = learnt(moved, until_s=LEARNING_S)
    assert learning.baseline(LEARNING_S, SHUTOFF_M) is None
    assert learning.reason.startswith(f"the {curve} curve moved by ")
    assert learning.reason.endswith(" m while it was learnt")


def test_learning_ends_once_a_disturbance_has_left_the_window():
    def moved(end_s):
        return (-3.0 if 3_000.0 < end_s < 9_000.0 else 0.0), 0.0

    learning, rng, ended_s = Learning(), np.random.default_rng(0), None
    for end_s in np.arange(EVERY_S, 3 * LEARNING_S, EVERY_S):
        learning.add(made_run(end_s, rng, pump_m=moved(end_s)[0]), end_s)
        if ended_s is None and learning.baseline(end_s, SHUTOFF_M) is not None:
            ended_s = end_s
            offset_m = learning.baseline(end_s, SHUTOFF_M).offset_m
    assert 9_000.0 + LEARNING_S - EVERY_S <= ended_s <= 9_000.0 + LEARNING_S + EVERY_S
    np.testing.assert_allclose(offset_m, 0.0, atol=0.05)


def test_baseline_scatter_is_that_of_the_runs_plus_a_floor():
    rng = np.random.default_rng(1)
    runs = [made_run(n, rng, pump_m=shift) for n, shift in enumerate(rng.normal(0.0, 0.5, 400))]
    baseline = learn(runs, SHUTOFF_M)
    np.testing.assert_allclose(np.diag(baseline.segment_covariance), [0.06**2, 0.1**2], rtol=0.1)
    np.testing.assert_allclose(baseline.run_variance, [0.5**2 + 0.072**2, 0.072**2], rtol=0.2)


def test_the_noise_follows_recent_runs_with_its_correlation_and_the_offset_does_not():
    rng = np.random.default_rng(2)
    runs = [made_run(n, rng) for n in range(20)]
    for run in runs:
        run.segments[:] = np.repeat(run.segments[::2], 2, axis=0)
    baseline = learn(runs, SHUTOFF_M)
    assert 2.0 < baseline.correlation_factor < 4.0
    followed = baseline
    for _ in range(200):
        followed = followed.with_noise_of(runs[rng.integers(20)], 0.05)
    assert 0.6 < np.trace(followed.segment_covariance) / np.trace(baseline.segment_covariance) < 1.6
    noisier = baseline.with_noise_of(made_run(0, rng, pump_m=9.0), 0.5)
    assert (noisier.offset_m == baseline.offset_m).all()


@pytest.mark.parametrize("gap_m", [-3.75, 3.85])
def test_a_pump_that_differs_from_its_siblings_is_refused(gap_m):
    message = sibling_objection(0, [gap_m, 0.0, 0.1], [CURVE] * 3)
    assert message.startswith(f"its curve lies {gap_m - 0.05:+.1f} m from that of its siblings")
    assert sibling_objection(1, [gap_m, 0.0, 0.1], [CURVE] * 3) is None


def test_only_pumps_of_the_same_curve_that_are_known_are_siblings():
    other = (40.0, 0.0, -2e-4)
    assert sibling_objection(0, [-9.0, 0.0], [CURVE, other]) is None
    assert sibling_objection(0, [-9.0, None], [CURVE, CURVE]) is None
    assert sibling_objection(0, [None, 0.0], [CURVE, CURVE]) is None
    assert sibling_objection(0, [-3.5, 0.0], [CURVE, CURVE]) is None


@pytest.mark.parametrize("seed", [0, 1])
def test_the_papers_blockage_within_learning_is_never_learnt(alpha, seed):
    recording = Simulation(alpha, find_scenario("blockage"), seed).advance(55_000)
    start_ns = int(recording.time_ns[0])
    detector = Detector(alpha.name, nominal_of(alpha))
    verdicts = [verdict for sample in recording.samples(alpha.name) for verdict in detector.update(sample)]
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
