"""What the tests of the detector share: made runs, and a detector that has learnt the paper's station."""

import copy

import numpy as np
import pytest
from judging import verdicts_on

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.runs.run import Run, Segments
from wetwell.detector.stream.steady_samples import SEGMENT_SAMPLES
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

SEED = 3
LEARNT_S = 24_000


def make_segments(residual_m, *, flow_m3h=200.0, total_m3h=None, duty_m3h=None, level_m=1.0, speed_ratio=1.0):
    """Segments with these (m, 2) residuals; Q/N and the rest are the same for all, or one value each."""
    residual_m = np.array(residual_m, dtype=float)

    def each(value):
        return np.array(np.broadcast_to(np.asarray(value, dtype=float), len(residual_m)))

    total_m3h = each(np.asarray(flow_m3h) * speed_ratio if total_m3h is None else total_m3h)
    duty_m3h = each(flow_m3h if duty_m3h is None else duty_m3h)
    return Segments(
        residual_m=residual_m,
        flow_m3h=each(flow_m3h),
        total_m3h=total_m3h,
        duty_m3h=duty_m3h,
        duty_total_m3h=total_m3h * duty_m3h / each(flow_m3h),
        level_m=each(level_m),
        speed_ratio=each(speed_ratio),
    )


def make_run(segments, *, head_m=26.0, flow_m3h=None, power_kw=np.nan, window_ns=None):
    """A run of pump 1 with these segments; flow and head of a sample each, or one for all."""
    samples = len(segments) * SEGMENT_SAMPLES

    def each(value):
        return np.array(np.broadcast_to(np.asarray(value, dtype=float), samples))

    def repeated(values):
        return np.repeat(values, SEGMENT_SAMPLES)

    return Run(
        pump=0,
        window_ns=(0, samples * NS_PER_S) if window_ns is None else window_ns,
        time_s=np.arange(float(samples)),
        flow_m3h=repeated(segments.flow_m3h * segments.speed_ratio) if flow_m3h is None else each(flow_m3h),
        head_m=each(head_m),
        speed_ratio=repeated(segments.speed_ratio),
        total_flow_m3h=repeated(segments.total_m3h),
        level_m=repeated(segments.level_m),
        power_kw=each(power_kw),
        segments=segments,
        missing=frozenset(),
    )


@pytest.fixture(scope="session")
def segments_of():
    return make_segments


@pytest.fixture(scope="session")
def run_of():
    return make_run


def part_of(recording, first_s):
    """The rows from a second on."""
    return Recording(
        time_ns=recording.time_ns[first_s:],
        columns={name: values[first_s:].copy() for name, values in recording.columns.items()},
        truth={name: values[first_s:] for name, values in recording.truth.items()},
    )


@pytest.fixture(scope="session")
def learnt(alpha):
    """A detector that has learnt the paper's station; to be copied before it is used."""
    before = Simulation(alpha, Scenario(name="healthy"), SEED).advance(LEARNT_S)
    detector = Detector(alpha.name, datasheet_of(alpha))
    last = {verdict.pump: verdict.state for verdict in verdicts_on(detector, before)}
    assert last == {1: "normal", 2: "normal", 3: "normal"}
    return detector


@pytest.fixture(scope="session")
def judge_after_learning(alpha, learnt):
    """Function that judges the seconds after learning, with faults that begin in them."""

    def judge(*faults, seconds=9_000, change=None):
        recording = Simulation(alpha, Scenario(name="faulty", fault=faults), SEED).advance(LEARNT_S + seconds)
        after = part_of(recording, LEARNT_S)
        if change is not None:
            change(after.columns)
        detector = copy.deepcopy(learnt)
        return [*verdicts_on(detector, after, LEARNT_S), *detector.finish()]

    return judge
