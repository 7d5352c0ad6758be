"""Sensors that are stuck, told from their readings."""

import math

import numpy as np
import pytest

from wetwell.detector.stream.run_state import PUMP_STATE
from wetwell.detector.stream.stuck_sensors import new_stuck_sensors, stuck_names, watch_sensors
from wetwell.protocols.timestamps import NS_PER_S

NAN = math.nan


def feed(sensors, *, level_m, flow_m3h, head_m, is_learning=False, is_running=True):
    """Feed equally long series; the names that are stuck after each second."""
    stuck, pumps = [], np.zeros(1, dtype=PUMP_STATE)
    pumps["is_learning"], pumps["is_running"] = is_learning, is_running
    for second, (level, flow, head) in enumerate(zip(level_m, flow_m3h, head_m, strict=True)):
        frame = np.array([level, NAN, 50.0, flow, head, NAN, float(is_running)])
        watch_sensors(sensors, second * NS_PER_S, 1.0, 1.0, frame, pumps)
        bits = sum(int(is_stuck) << bit for bit, is_stuck in enumerate(sensors["is_stuck"]))
        stuck.append(set(stuck_names(0, bits)))
        if is_running:
            assert pumps["stuck"][0] & bits == bits, "the run remembers what was stuck"
    return stuck


def lively(rng, seconds):
    return {
        "level_m": 1.0 + 0.002 * rng.normal(size=seconds),
        "flow_m3h": 200.0 + rng.normal(size=seconds),
        "head_m": 26.0 + 0.2 * rng.normal(size=seconds),
    }


@pytest.mark.parametrize(
    ("name", "reading"), [("level_m", "level_m"), ("flow_m3h", "pump1_flow_m3h"), ("head_m", "pump1_head_m")]
)
def test_a_reading_that_stands_still_for_a_minute_is_stuck_until_it_moves(name, reading):
    rng, sensors = np.random.default_rng(0), new_stuck_sensors(1)
    feed(sensors, **lively(rng, 600), is_learning=True)
    series = lively(rng, 200)
    series[name][20:120] = series[name][20]
    stuck = feed(sensors, **series)
    first = next(second for second, names in enumerate(stuck) if names)
    assert first == pytest.approx(80, abs=2)
    assert all(names == {reading} for names in stuck[first:120])
    assert not any(stuck[120:])


def test_readings_of_zero_are_not_stuck():
    sensors = new_stuck_sensors(1)
    zeros = np.zeros(500)
    assert not any(
        feed(sensors, level_m=lively(np.random.default_rng(0), 500)["level_m"], flow_m3h=zeros, head_m=zeros)
    )


def test_the_head_of_a_pump_that_stands_still_may_too():
    series = lively(np.random.default_rng(0), 500) | {"head_m": np.full(500, 3.3)}
    assert not any(feed(new_stuck_sensors(1), **series, is_running=False))


def test_values_that_are_absent_are_not_stuck():
    absent = np.full(500, NAN)
    assert not any(feed(new_stuck_sensors(1), level_m=absent, flow_m3h=absent, head_m=absent))


def by_exception(values, every):
    return np.repeat(values[::every], every)[: len(values)]


def test_a_feed_that_reports_by_exception_in_health_is_learnt():
    rng, sensors = np.random.default_rng(1), new_stuck_sensors(1)
    feed(sensors, **{name: by_exception(values, 40) for name, values in lively(rng, 2000).items()}, is_learning=True)
    slow = {name: by_exception(values, 100) for name, values in lively(rng, 1000).items()}
    assert not any(feed(sensors, **slow)), "five times as long as ever is not yet stuck"
    dead = lively(rng, 400) | {"flow_m3h": np.full(400, 201.5)}
    stuck = feed(sensors, **dead)
    assert stuck[-1] == {"pump1_flow_m3h"}
    assert not any(stuck[:190])
