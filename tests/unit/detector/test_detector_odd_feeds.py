"""Feeds that are odd or broken: nothing crashes, nobody is blamed for the feed."""

import math

import numpy as np
import pytest

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.inference.posterior import FAULT_STATES
from wetwell.protocols.messages.readings import PumpRow, Row
from wetwell.protocols.timestamps import NS_PER_S

OFF = PumpRow(0.0, 0.0, 0.0, 0.0, False)
CYCLE_S, RUN_S = 600, 300
HOURS = 9


def judged(alpha, reading, *, level_m=1.0, hours=HOURS, pumps=3):
    """Verdicts on cycles of a run and a rest, the pumps in turn; `reading(second, pump)` while one runs."""
    detector = Detector(alpha.name, datasheet_of(alpha))
    verdicts = []
    for second in range(hours * 3600):
        turn = second // CYCLE_S % pumps
        runs = second % CYCLE_S < RUN_S
        rows = tuple(reading(second, pump) if runs and pump == turn else OFF for pump in range(3))
        verdicts += detector.update(Row(second, second * NS_PER_S, level_m, math.nan, rows))
    return [*verdicts, *detector.finish()]


@pytest.mark.parametrize("level_m", [1.0, math.nan], ids=["level", "no level"])
def test_readings_without_any_noise_are_learnt_and_a_change_is_told(alpha, level_m):
    def constant(second, _pump):
        return PumpRow(50.0, 200.0, 26.0 if second < 8 * 3600 else 20.0, 15.0, True)

    verdicts = judged(alpha, constant, level_m=level_m)
    told = [verdict.state for verdict in verdicts if verdict.state != "learning"]
    assert told
    assert all(math.isfinite(share) for verdict in verdicts for share in verdict.probability.values())


def test_noise_after_learning_without_any_crashes_nothing(alpha):
    rng = np.random.default_rng(1)

    def then_noisy(second, _pump):
        noise = 0.0 if second < 7 * 3600 else 0.3 * float(rng.normal())
        return PumpRow(50.0, 200.0 + noise, 26.0 + noise, 15.0, True)

    verdicts = judged(alpha, then_noisy)
    assert not [verdict for verdict in verdicts if verdict.state in FAULT_STATES]


def test_a_standby_pump_does_not_hide_a_stuck_meter_of_another(alpha):
    rng = np.random.default_rng(2)

    def stuck(second, pump):
        flow_m3h = 200.0 if pump == 0 and second > 8 * 3600 else 200.0 + float(rng.normal())
        return PumpRow(50.0, flow_m3h, 26.0 + 0.1 * float(rng.normal()), 15.0 + 0.1 * float(rng.normal()), True)

    verdicts = judged(alpha, stuck, pumps=2)
    last = {verdict.pump: verdict for verdict in verdicts}
    assert last[3].state == "learning"
    assert (last[1].state, last[1].evidence["stuck"]) == ("sensor_fault", ["pump1_flow_m3h"])
    assert last[2].state == "normal"


def test_a_rest_between_equal_readings_is_no_repeat(alpha):
    rng = np.random.default_rng(3)

    def equal_at_both_ends(second, _pump):
        at = second % CYCLE_S
        head_m = 26.0 if at < 3 or at >= RUN_S - 3 else 26.0 + 0.1 * float(rng.normal())
        return PumpRow(50.0, 200.0 + float(rng.normal()), head_m, 15.0 + 0.1 * float(rng.normal()), True)

    verdicts = judged(alpha, equal_at_both_ends, pumps=1)
    assert not [verdict for verdict in verdicts if verdict.state == "sensor_fault"]
    assert verdicts[-1].state == "normal"


def test_samples_that_all_come_at_once_are_doubled_ones(alpha):
    detector = Detector(alpha.name, datasheet_of(alpha))
    for number in range(1000):
        detector.update(Row(number, number, 1.0, math.nan, (OFF,) * 3))
    assert detector.counts["doubled"] == 999


def test_a_clock_that_is_set_back_leaves_no_window_after_its_verdict(alpha):
    detector = Detector(alpha.name, datasheet_of(alpha))
    on = PumpRow(50.0, 200.0, 26.0, 15.0, True)
    stamps = [*range(5000, 5200), *range(1000, 1200)]
    verdicts = [
        verdict
        for number, second in enumerate(stamps)
        for verdict in detector.update(Row(number, second * NS_PER_S, 1.0, math.nan, (on, OFF, OFF)))
    ]
    assert len(verdicts) > 3
    assert all(verdict.window[1] <= verdict.time for verdict in verdicts)
