"""Metered flow against what leaves the wet well, on level traces of which the truth is known."""

import math
from typing import NamedTuple

import numpy as np
import pytest

from wetwell.detector.stream.drawdown import DEAD_RATIO, draw_down, new_phases
from wetwell.detector.stream.run_state import PUMP_STATE, new_sampling_period, note_gap
from wetwell.protocols.timestamps import NS_PER_S

AREA_M2 = 8.0
NAN = math.nan
FLOW_M3H = 200.0


class Frame(NamedTuple):
    """A sample that has passed the gate."""

    time_ns: int
    gap_s: float
    level_m: float
    inflow_m3h: float
    flows_m3h: tuple[float, ...]


def trace(*phases, inflow_m3h=lambda _second: 60.0, ratio=1.0, is_inflow_measured=False, rng=None, gap_at=None):
    """Frames of one station: phases of (seconds, which of two pumps run); each pump takes out 200 m³/h."""
    rng = np.random.default_rng(0) if rng is None else rng
    level_m, second = 3.0, 0
    for seconds, running in phases:
        for _ in range(seconds):
            inflow = inflow_m3h(second)
            level_m += (inflow - sum(running) * FLOW_M3H) / 3600.0 / AREA_M2
            flows_m3h = tuple(ratio * FLOW_M3H * on * (1.0 + 0.01 * rng.normal()) for on in running)
            gap_s = 60.0 if second == gap_at else 1.0
            measured = inflow * (1.0 + 0.01 * rng.normal()) if is_inflow_measured else NAN
            yield (
                Frame(second * NS_PER_S, gap_s, level_m + 0.002 * rng.normal(), measured, flows_m3h),
                tuple(map(bool, running)),
            )
            second += 1


IDLE, ONE, TWO = (0, 0), (1, 0), (1, 1)


def told_of_both(frames, *, area_m2=AREA_M2):
    phases, pumps, period = new_phases(), np.zeros(2, dtype=PUMP_STATE), new_sampling_period()
    pumps["log_ratio"] = NAN
    for frame, running in frames:
        pumps["is_running"] = running
        flows = (value for flow_m3h in frame.flows_m3h for value in (NAN, flow_m3h, NAN, NAN, NAN))
        values = np.array([frame.level_m, frame.inflow_m3h, *flows])
        draw_down(
            phases, area_m2, period[0], frame.time_ns, frame.gap_s, values, np.zeros(len(pumps), dtype=bool), pumps
        )
        note_gap(period[0], frame.gap_s)
    return pumps["log_ratio"].tolist()


def told(frames, *, area_m2=AREA_M2):
    return told_of_both(frames, area_m2=area_m2)[0]


@pytest.mark.parametrize("is_inflow_measured", [False, True])
@pytest.mark.parametrize("ratio", [0.7, 1.0, 1.15])
def test_the_ratio_is_that_of_meter_and_water(ratio, is_inflow_measured):
    found = [
        told(
            trace(
                (300, IDLE),
                (200, ONE),
                (5, IDLE),
                ratio=ratio,
                is_inflow_measured=is_inflow_measured,
                rng=np.random.default_rng(seed),
            )
        )
        for seed in range(10)
    ]
    np.testing.assert_allclose(found, math.log(ratio), atol=0.02)


def test_a_measured_inflow_may_change_between_rest_and_run():
    def rising(second):
        return 30.0 if second < 300 else 90.0

    frames = {"inflow_m3h": rising, "ratio": 0.9}
    phases = ((300, IDLE), (200, ONE), (5, IDLE))
    assert told(trace(*phases, **frames, is_inflow_measured=True)) == pytest.approx(math.log(0.9), abs=0.02)
    unmeasured = told(trace(*phases, **frames))
    assert unmeasured == pytest.approx(math.log(0.9 * 200.0 / 140.0), abs=0.03), "taken for a smaller pump"


def test_a_wrong_area_moves_the_figure_by_a_constant_only():
    healthy, biased = (
        told(trace((300, IDLE), (200, ONE), (5, IDLE), ratio=ratio), area_m2=2.0 * AREA_M2) for ratio in (1.0, 1.15)
    )
    assert healthy == pytest.approx(-math.log(2.0), abs=0.02)
    assert biased - healthy == pytest.approx(math.log(1.15), abs=0.001)


def test_a_dead_meter_has_the_least_ratio_there_is():
    assert told(trace((300, IDLE), (200, ONE), (5, IDLE), ratio=0.0)) == pytest.approx(math.log(DEAD_RATIO))


def test_the_figure_is_given_to_its_pump():
    first, second = told_of_both(trace((300, IDLE), (200, (0, 1)), (5, IDLE)))
    assert math.isnan(first)
    assert second == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize(
    ("phases", "gap_at"),
    [
        (((300, IDLE), (200, TWO), (5, IDLE)), None),
        (((200, ONE), (5, IDLE)), None),
        (((300, IDLE), (50, ONE), (5, IDLE)), None),
        (((40, IDLE), (200, ONE), (5, IDLE)), None),
        (((300, IDLE), (700, TWO), (200, ONE), (5, IDLE)), None),
        (((300, IDLE), (55, ONE), (5, IDLE)), 330),
    ],
    ids=["two pumps", "no rest", "short run", "short rest", "rest long ago", "gap"],
)
def test_without_a_run_of_one_pump_after_a_rest_nothing_is_told(phases, gap_at):
    assert math.isnan(told(trace(*phases, gap_at=gap_at)))


def test_the_inflow_just_before_the_run_counts_and_not_that_of_hours_ago():
    def evening(second):
        return 120.0 if second < 5_000 else 20.0

    ratio = told(trace((7_000, IDLE), (200, ONE), (5, IDLE), inflow_m3h=evening))
    assert ratio == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("period_s", [5, 20, 60])
def test_a_slow_feed_tells_too(period_s):
    frames = list(trace((600, IDLE), (600, ONE), (120, IDLE), ratio=0.9))[::period_s]
    slow = ((frame._replace(gap_s=float(period_s)), running) for frame, running in frames)
    assert told(slow) == pytest.approx(math.log(0.9), abs=0.03)


def test_no_level_no_figure():
    frames = ((frame._replace(level_m=NAN), running) for frame, running in trace((300, IDLE), (200, ONE), (5, IDLE)))
    assert math.isnan(told(frames))
