"""Start, stop and rotation of the pumps, and the ramps of their drives, second by second."""

import numpy as np
import pytest

from wetwell.protocols.station.control import Control
from wetwell.simulator.control.drive import next_frequency_hz
from wetwell.simulator.control.rules import NOTHING, next_in_rotation, wanted_change
from wetwell.simulator.inflow.recorded import RecordedInflow
from wetwell.simulator.parameters import FIXED, LEAST_RUN_TIME, ROUND_ROBIN
from wetwell.simulator.records import records_of
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation
from wetwell.simulator.state import PumpState

STARTS_M, STOPS_M = np.array([1.6, 1.8, 2.0]), np.array([0.5, 0.8, 1.0])
RUN_S = (30.0, 10.0, 20.0)


class Bench:
    """A station whose level the test sets before each second."""

    def __init__(self, station, **control):
        levels = {"start_levels_m": tuple(STARTS_M.tolist()), "stop_levels_m": tuple(STOPS_M.tolist())}
        station = station.model_copy(update={"control": Control(**(levels | control))})
        dry = RecordedInflow(time_s=[0.0], flow_m3h=[0.0])
        self.simulation = Simulation(station, Scenario(name="bench", inflow=dry), seed=1)

    def at(self, level_m, seconds=1):
        """Hold a level for some seconds; the frequencies of each pump in them, (pumps, seconds)."""
        rows = []
        for _ in range(seconds):
            self.simulation._plant.level_m = level_m
            recording = self.simulation.advance(1)
            rows.append([recording.columns[f"pump{i}_frequency_hz"][0] for i in (1, 2, 3)])
        return np.array(rows).T

    @property
    def commanded(self):
        """Numbers of the commanded pumps, from 1."""
        return sorted(self.simulation._plant.commanded)


@pytest.fixture
def bench(quiet_alpha):
    return Bench(quiet_alpha)


def test_ramp_crosses_half_speed_after_half_the_ramp(bench):
    """Commanded in second 0, the drive moves from second 1 on: 25 Hz after 5 s, 50 Hz after 10 s."""
    frequency_hz = bench.at(1.6, 14)[0]
    assert frequency_hz == pytest.approx([*np.arange(0.0, 50.0, 5.0), 50.0, 50.0, 50.0, 50.0])
    assert frequency_hz[5] == pytest.approx(25.0)


@pytest.mark.parametrize("nominal_hz", [50.0, 60.0])
@pytest.mark.parametrize("ramp_s", range(1, 61))
def test_a_ramp_of_whole_seconds_takes_just_as_many(ramp_s, nominal_hz):
    """Without a second at 49.999… or at 1e-14 Hz from the rounding of the sum."""
    rising, falling = [0.0], [nominal_hz]
    for _ in range(ramp_s):
        rising.append(next_frequency_hz(rising[-1], True, nominal_hz / ramp_s, 0.0, nominal_hz, 0.0))
        falling.append(next_frequency_hz(falling[-1], False, nominal_hz / ramp_s, 0.0, nominal_hz, 0.0))
    assert rising[-1] == nominal_hz
    assert falling[-1] == 0.0
    assert rising[-2] < nominal_hz
    assert falling[-2] > 0.0


def test_reversal_in_mid_ramp_goes_on_from_where_the_drive_is(bench):
    rising = bench.at(1.7, 5)[0]
    turned = bench.at(0.4, 3)[0]
    risen_again = bench.at(1.7, 3)
    assert rising == pytest.approx([0, 5, 10, 15, 20])
    assert turned == pytest.approx([25, 20, 15])
    # The second pump of the rotation starts; the first goes on falling.
    assert risen_again[0] == pytest.approx([10, 5, 0])
    assert risen_again[1] == pytest.approx([0, 5, 10])


def test_one_pump_reverses_in_mid_fall(bench):
    bench.simulation.change_settings({"pump2_auto": 0, "pump3_auto": 0})
    assert bench.at(1.6, 11)[0, -1] == pytest.approx(50)
    assert bench.at(0.5, 4)[0] == pytest.approx([50, 45, 40, 35])
    assert bench.at(1.6, 4)[0] == pytest.approx([30, 35, 40, 45])


def test_minimum_frequency_and_dwell(quiet_alpha):
    """The start jumps over the frequencies under the minimum; the stop stays at it for the dwell, then stands."""
    bench = Bench(quiet_alpha, min_frequency_hz=20.0, dwell_s=4.0)
    assert bench.at(1.6, 9)[0] == pytest.approx([0, 25, 30, 35, 40, 45, 50, 50, 50])
    assert bench.at(0.5, 13)[0] == pytest.approx([50, 45, 40, 35, 30, 25, 20, 20, 20, 20, 0, 0, 0])


def test_dwell_is_whole_again_after_a_reversal(quiet_alpha):
    bench = Bench(quiet_alpha, min_frequency_hz=40.0, dwell_s=3.0)
    bench.simulation.change_settings({"pump2_auto": 0, "pump3_auto": 0})
    bench.at(1.6, 5)
    assert bench.at(0.5, 5)[0] == pytest.approx([50, 45, 40, 40, 40])
    bench.at(1.6, 5)
    assert bench.at(0.5, 7)[0] == pytest.approx([50, 45, 40, 40, 40, 0, 0])


def test_without_a_dwell_the_minimum_is_passed_in_one_second(quiet_alpha):
    bench = Bench(quiet_alpha, min_frequency_hz=40.0)
    bench.at(1.6, 5)
    assert bench.at(0.5, 4)[0] == pytest.approx([50, 45, 40, 0])


def test_round_robin_over_all_pumps(bench):
    started = []
    for _ in range(5):
        bench.at(1.65)
        started += bench.commanded
        bench.at(0.4)
        assert bench.commanded == []
    assert started == [1, 2, 3, 1, 2]


def test_round_robin_skips_a_pump_that_is_switched_off(bench):
    bench.simulation.change_settings({"pump2_auto": 0})
    started = []
    for _ in range(4):
        bench.at(1.65)
        started += bench.commanded
        bench.at(0.4)
    assert started == [1, 3, 1, 3]


def test_further_pumps_start_at_their_own_levels(bench):
    bench.at(1.59)
    assert bench.commanded == []
    bench.at(1.6)
    assert bench.commanded == [1]
    bench.at(1.79, 5)
    assert bench.commanded == [1]
    bench.at(1.8)
    assert bench.commanded == [1, 2]
    bench.at(1.99, 5)
    assert bench.commanded == [1, 2]
    bench.at(2.0, 5)
    assert bench.commanded == [1, 2, 3]


def test_last_started_stops_first(bench):
    bench.at(0.4)
    bench.at(1.65)
    bench.at(0.4)
    bench.at(2.1)
    bench.at(2.1)
    bench.at(2.1)
    assert bench.commanded == [1, 2, 3]
    assert bench.simulation._plant.commanded == [2, 3, 1]
    bench.at(1.01, 5)
    assert bench.commanded == [1, 2, 3]
    bench.at(1.0)
    assert bench.commanded == [2, 3]
    bench.at(0.81, 5)
    assert bench.commanded == [2, 3]
    bench.at(0.8)
    assert bench.commanded == [2]
    bench.at(0.5)
    assert bench.commanded == []


def test_a_pump_switched_off_in_the_middle_leaves_the_order_of_the_others(bench):
    bench.at(2.1, 3)
    bench.simulation.change_settings({"pump2_auto": 0})
    bench.at(1.5)
    assert bench.commanded == [1, 3]
    bench.at(0.8)
    assert bench.commanded == [1]


def test_fewer_levels_than_pumps_leave_a_standby_in_rotation(quiet_alpha):
    bench = Bench(quiet_alpha, start_levels_m=(1.6,), stop_levels_m=(0.5,))
    started = []
    for _ in range(4):
        bench.at(3.0, 5)
        started += bench.commanded
        bench.at(0.4)
    assert started == [1, 2, 3, 1]


@pytest.mark.parametrize(
    ("level_m", "running", "change"),
    [
        (1.59, 0, 0),
        (1.6, 0, 1),
        (1.7, 1, 0),
        (1.8, 1, 1),
        (0.5, 1, -1),
        (0.51, 1, 0),
        (0.8, 2, -1),
        (1.0, 3, -1),
        (9.0, 3, 0),
        (0.0, 0, 0),
        (float("nan"), 1, 0),
    ],
)
def test_wanted_change(level_m, running, change):
    assert wanted_change(level_m, running, STARTS_M, STOPS_M) == change


@pytest.mark.parametrize(
    ("rotation", "turn", "ready", "chosen"),
    [
        (ROUND_ROBIN, 2, [1, 1, 1], 2),
        (ROUND_ROBIN, 2, [1, 1, 0], 0),
        (ROUND_ROBIN, 1, [1, 0, 0], 0),
        (FIXED, 2, [0, 1, 1], 1),
        (LEAST_RUN_TIME, 2, [1, 1, 1], 1),
        (LEAST_RUN_TIME, 0, [1, 0, 1], 2),
        (ROUND_ROBIN, 0, [0, 0, 0], NOTHING),
        (FIXED, 0, [0, 0, 0], NOTHING),
        (LEAST_RUN_TIME, 0, [0, 0, 0], NOTHING),
    ],
)
def test_rotation(rotation, turn, ready, chosen):
    pumps = [PumpState(run_s=run_s, is_ready=bool(is_ready)) for run_s, is_ready in zip(RUN_S, ready, strict=True)]
    assert next_in_rotation(rotation, turn, records_of(pumps)) == chosen


@pytest.mark.parametrize(
    ("changes", "rule"),
    [
        ({"level_m": 1.0}, "level_m is not a setting of station 'alpha'"),
        ({"start_level4_m": 3.0}, "start_level4_m is not a setting"),
        ({"start_level1_m": 0.4}, "must lie under"),
        ({"stop_level3_m": 0.7}, "must not fall"),
        ({"start_level2_m": float("nan")}, "must be finite"),
        ({"stop_level1_m": float("-inf")}, "must be finite"),
        ({"pump1_auto": 0, "start_level1_m": 9.0}, "must not fall"),
    ],
)
def test_settings_that_would_not_work_are_refused_as_a_whole(bench, changes, rule):
    before = bench.simulation.settings
    with pytest.raises(ValueError, match=rule):
        bench.simulation.change_settings(changes)
    assert bench.simulation.settings == before


def test_settings_of_one_simulation_leave_the_station_alone(quiet_alpha):
    first, second = Bench(quiet_alpha).simulation, Bench(quiet_alpha).simulation
    first.change_settings({"start_level1_m": 1.1, "pump3_auto": 0})
    assert second.settings["start_level1_m"] == 1.6
    assert second.settings["pump3_auto"] == 1
    assert quiet_alpha.control.start_levels_m == (1.6, 1.8, 2.0)
