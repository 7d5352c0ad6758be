"""Signals and duty points of a recording."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.isolability.recorded import recorded_points, recorded_signals
from wetwell.simulator.parameters import plant_parameters
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation


@pytest.fixture(scope="module")
def recording(alpha):
    return Simulation(alpha, Scenario(name="r"), 1).advance(20_000, truth=False)


def points_of(recording, alpha):
    return recorded_points(recording, alpha, plant_parameters(alpha))


def test_signals_are_those_that_move(recording):
    assert recorded_signals(recording) == ("level_m", "inflow_m3h", "flow_m3h", "head_m", "power_kw")
    columns = {name: values for name, values in recording.columns.items() if "head" not in name}
    columns |= {f"pump{i}_power_kw": np.zeros(len(recording)) for i in (1, 2, 3)}
    assert recorded_signals(replace(recording, columns=columns)) == ("level_m", "inflow_m3h", "flow_m3h")


def test_points_are_states_that_follow_each_other_at_their_levels(recording, alpha):
    points = points_of(recording, alpha)
    states = {point.frequency_hz for point in points}
    assert states >= {(0.0, 0.0, 0.0), (50.0, 0.0, 0.0), (0.0, 50.0, 0.0), (0.0, 0.0, 50.0)}
    assert all(hz in {0.0, 50.0} for state in states for hz in state)
    levels_m = [point.level_m for point in points]
    assert min(levels_m) > 0.4
    assert max(levels_m) < 2.1
    for cycle in {point.cycle for point in points}:
        assert len([point for point in points if point.cycle == cycle]) == 4
    assert {point.every_s for point in points} == {1.0}
    assert all(0.0 < point.inflow_m3h < 400.0 for point in points)


def test_slow_rows_have_fewer_values_and_none_within_ramps(recording, alpha):
    slow = replace(
        recording,
        time_ns=recording.time_ns[::60],
        columns={name: values[::60] for name, values in recording.columns.items()},
    )
    points = points_of(slow, alpha)
    assert {point.every_s for point in points} == {60.0}
    assert all(hz in {0.0, 50.0} for point in points for hz in point.frequency_hz)
    assert sum(point.values for point in points) < sum(point.values for point in points_of(recording, alpha))


def test_a_pump_that_never_stops_is_one_state(alpha):
    columns = {f"pump{i}_frequency_hz": np.full(500, 45.0 if i == 1 else 0.0) for i in (1, 2, 3)}
    steady = Recording(time_ns=NS_PER_S * np.arange(500), columns=columns)
    points = points_of(steady, alpha)
    assert {point.frequency_hz for point in points} == {(45.0, 0.0, 0.0)}
    assert {point.level_m for point in points} == {alpha.middle_level_m}


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"pump1_frequency_hz": np.full(9, 50.0)}, "the recording has 1 pumps, station 'alpha' 3"),
        ({"pump3_flow_m3h": np.full(9, 50.0)}, "neither frequencies nor running flags have values"),
        ({"pump3_frequency_hz": np.arange(9) % 2 * 50.0}, "no state lasts for two rows"),
    ],
)
def test_what_has_no_duty_point_is_refused(columns, said, alpha):
    with pytest.raises(ValueError, match=said):
        points_of(Recording(time_ns=60 * NS_PER_S * np.arange(9), columns=columns), alpha)
