"""Level controller, limits on starts, rotation, pumps out of service, and the wet well's shape, in whole runs."""

import numpy as np
import pytest

from wetwell.protocols.station.control import Control
from wetwell.protocols.station.sump import Sump
from wetwell.simulator.control.rules import controlled_frequency_hz
from wetwell.simulator.inflow.diurnal import DiurnalInflow
from wetwell.simulator.inflow.recorded import RecordedInflow
from wetwell.simulator.inflow.surges import Surges
from wetwell.simulator.records import records_of
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation
from wetwell.simulator.state import StationState

DAY_S = 86_400
SETPOINT_M = 1.2
PID = {
    "mode": "pid",
    "setpoint_m": SETPOINT_M,
    "gain_hz_m": 40.0,
    "integral_s": 120.0,
    "start_levels_m": (1.3, 1.8, 2.0),
    "stop_levels_m": (0.5, 0.8, 1.0),
    "min_frequency_hz": 15.0,
}


def steady(*flows_m3h, step_s=3600.0):
    """Inflow in steps."""
    return RecordedInflow(time_s=[step_s * n for n in range(len(flows_m3h))], flow_m3h=flows_m3h)


def run(station, inflow, seconds=DAY_S, level_m=1.0, **control):
    """Recording of a station with another control."""
    station = station.model_copy(update={"control": Control(**control)})
    return Simulation(station, Scenario(name="run", initial_level_m=level_m, inflow=inflow), seed=1).advance(seconds)


def frequencies(recording):
    return np.array([recording.columns[f"pump{i}_frequency_hz"] for i in range(1, recording.pumps + 1)])


def starts_s(recording):
    """Seconds of the starts of each pump."""
    frequency_hz = frequencies(recording)
    return [np.flatnonzero((row[1:] > 0) & (row[:-1] <= 0)) + 1 for row in frequency_hz]


def test_level_stays_at_the_setpoint_under_a_constant_inflow(quiet_alpha):
    """After the first hour within a millimetre, by one pump that never stops."""
    recording = run(quiet_alpha, steady(120.0), **PID)
    settled = slice(3600, None)
    np.testing.assert_allclose(recording.truth["truth_level_m"][settled], SETPOINT_M, rtol=0, atol=1e-3)
    assert [row.size for row in starts_s(recording)] == [1, 0, 0]
    assert np.ptp(frequencies(recording)[0, settled]) < 0.1


def test_level_stays_in_a_band_under_a_diurnal_inflow(quiet_alpha):
    inflow = DiurnalInflow(mean_m3h=120.0, amplitude_m3h=50.0, noise_m3h=5.0, surges=Surges(rate_per_s=0.0))
    recording = run(quiet_alpha, inflow, **PID)
    np.testing.assert_allclose(recording.truth["truth_level_m"][3600:], SETPOINT_M, rtol=0, atol=0.02)
    assert [row.size for row in starts_s(recording)] == [1, 0, 0]


def test_the_controller_recovers_from_saturation_without_a_long_undershoot(quiet_alpha):
    """Two hours of more than a pump takes, with the others off: the level rises by metres, at full speed.

    Back in its range the loop has a damping of .5 sqrt(T_i / τ) = .46 with τ = A / (K dQ/df) = 144 s, and meets a
    level that falls by 3.6 mm a second: it undershoots by .2 m once. A controller that had gone on summing metres of
    error for hours would pump down to the stop level instead.
    """
    inflow = steady(120.0, 230.0, 230.0, 100.0, 100.0, 100.0, 100.0)
    recording = run(quiet_alpha, inflow, 7 * 3600, **PID, out_of_service=(2, 3))
    level_m, frequency_hz = recording.truth["truth_level_m"], frequencies(recording)[0]
    assert level_m.max() > SETPOINT_M + 3.0
    assert (frequency_hz[2 * 3600 : 3 * 3600] == 50.0).all()
    assert level_m[3 * 3600 :].min() > SETPOINT_M - 0.25
    assert level_m[-3600:] == pytest.approx(SETPOINT_M, abs=2e-3)
    assert [row.size for row in starts_s(recording)] == [1, 0, 0]


def test_the_integral_rests_while_a_limit_holds_the_output():
    """Above the setpoint at full speed nothing is summed; once the error turns, the sum moves again."""
    memory = records_of([StationState()])[0]
    arguments = (SETPOINT_M, 40.0, 120.0, 0.0, 15.0, 50.0, memory)
    for _ in range(1000):
        assert controlled_frequency_hz(3.0, *arguments) == 50.0
    assert memory["pid_integral_hz"] == 0.0
    assert controlled_frequency_hz(1.1, *arguments) < 50.0
    assert memory["pid_integral_hz"] < 0.0


def test_running_pumps_keep_the_minimum_frequency(quiet_alpha):
    """An inflow under what the slowest pump takes: it runs at its minimum down to the stop level, again and again."""
    recording = run(quiet_alpha, steady(20.0), **PID, dwell_s=5.0)
    frequency_hz = frequencies(recording)
    assert frequency_hz[frequency_hz > 0].min() == 15.0
    assert sum(row.size for row in starts_s(recording)) > 3
    assert np.count_nonzero(frequency_hz.max(axis=0) == 15.0) > 1000


@pytest.mark.parametrize("limit", [1, 3, 6])
def test_no_pump_starts_more_often_than_allowed(quiet_alpha, limit):
    """Levels so near that the pumps would start every few minutes; each start counts for an hour."""
    levels = {"start_levels_m": (1.6,), "stop_levels_m": (1.5,)}
    free = run(quiet_alpha, steady(100.0), **levels)
    assert sum(row.size for row in starts_s(free)) > 24 * 3 * limit
    limited = starts_s(run(quiet_alpha, steady(100.0), **levels, max_starts_per_hour=limit))
    for row in limited:
        assert (row[limit:] - row[:-limit] >= 3600).all()
        assert (row[limit:] - row[:-limit]).min() < 3610


@pytest.mark.parametrize("rotation", ["round_robin", "fixed", "least_run_time"])
def test_a_pump_out_of_service_never_starts(quiet_alpha, rotation):
    recording = run(quiet_alpha, steady(450.0), rotation=rotation, out_of_service=(2,))
    running = frequencies(recording).any(axis=1)
    assert running.tolist() == [True, False, True]


def test_fixed_rotation_always_starts_the_first(quiet_alpha):
    counts = [row.size for row in starts_s(run(quiet_alpha, steady(91.0), rotation="fixed"))]
    assert counts[0] > 100
    assert counts[1:] == [0, 0]


def test_round_robin_starts_all_as_often(quiet_alpha):
    counts = [row.size for row in starts_s(run(quiet_alpha, steady(91.0), rotation="round_robin"))]
    assert max(counts) - min(counts) <= 1


def test_least_run_time_evens_out_the_run_times(quiet_alpha):
    """Of pumps that wear unlike: the weaker one runs longer each time, and starts less often."""
    weak = quiet_alpha.pump[0].model_copy(update={"curve": (30.0, -0.02333, -2.0e-4)})
    station = quiet_alpha.model_copy(update={"pump": (weak, *quiet_alpha.pump[1:])})
    recording = run(station, steady(91.0), rotation="least_run_time")
    run_s = np.count_nonzero(frequencies(recording), axis=1)
    longest_run_s = DAY_S * 0.01
    assert np.ptp(run_s) <= longest_run_s
    counts = [row.size for row in starts_s(recording)]
    assert counts[0] < min(counts[1:])


@pytest.mark.parametrize(("dwell_s", "seconds"), [(0, 1), (1, 1), (7, 7)])
def test_a_stop_stays_at_the_minimum_for_the_dwell(quiet_alpha, dwell_s, seconds):
    """The ramp ends at the minimum, so that a second there is the least."""
    control = {"min_frequency_hz": 20.0, "dwell_s": float(dwell_s)}
    frequency_hz = frequencies(run(quiet_alpha, steady(91.0), 3600, **control)).max(axis=0)
    stops_s = np.flatnonzero((frequency_hz[1:] <= 0) & (frequency_hz[:-1] > 0))
    assert stops_s.size > 3
    for stop_s in stops_s:
        lowest = np.flatnonzero(frequency_hz[: stop_s + 1] > 20.0)[-1]
        assert stop_s - lowest == seconds


PROFILE = ((0.0, 3.0), (0.6, 5.0), (1.4, 9.0), (2.5, 9.0))


def volume_m3(level_m):
    """Volume over the profile by the trapezium rule, its area going on above: written here a second time."""
    levels_m, areas_m2 = np.array(PROFILE).T
    knots_m3 = np.concatenate([[0.0], np.cumsum(0.5 * (areas_m2[1:] + areas_m2[:-1]) * np.diff(levels_m))])
    k = np.clip(np.searchsorted(levels_m, level_m, side="right") - 1, 0, levels_m.size - 1)
    height_m = level_m - levels_m[k]
    return knots_m3[k] + 0.5 * height_m * (areas_m2[k] + np.interp(level_m, levels_m, areas_m2))


def test_mass_closes_over_a_profile_with_a_weir(quiet_alpha):
    """A storm of more than the pumps take: what is not stored or pumped leaves over the weir, to 1e-9 m³."""
    sump = Sump(area_m2=8.0, profile=PROFILE, overflow_level_m=2.2, weir_width_m=0.5)
    station = quiet_alpha.model_copy(update={"sump": sump})
    truth = run(station, steady(60.0, 900.0, 40.0), 3 * 3600).truth
    pumped_m3h = sum(truth[f"truth_pump{i}_flow_m3h"] for i in (1, 2, 3))
    net_m3 = (truth["truth_inflow_m3h"] - truth["truth_overflow_m3h"] - pumped_m3h) / 3600.0
    np.testing.assert_allclose(np.diff(volume_m3(truth["truth_level_m"])), net_m3[:-1], rtol=0, atol=1e-9)
    is_over = truth["truth_level_m"] > 2.2
    assert is_over.any()
    assert ((truth["truth_overflow_m3h"] > 0) == is_over).all()
    assert truth["truth_level_m"].max() < 2.2 + (300.0 / 3600.0 / 1.84 / 0.5) ** (2.0 / 3.0)


def test_the_weir_passes_what_its_equation_says(quiet_alpha):
    """In equilibrium without pumps: Q = 1.84 b h^1.5."""
    sump = Sump(area_m2=8.0, overflow_level_m=2.0, weir_width_m=1.5)
    station = quiet_alpha.model_copy(update={"sump": sump})
    truth = run(station, steady(100.0), 6 * 3600, level_m=2.0, out_of_service=(1, 2, 3)).truth
    height_m = (100.0 / 3600.0 / 1.84 / 1.5) ** (2.0 / 3.0)
    assert truth["truth_overflow_m3h"][-1] == pytest.approx(100.0, abs=1e-6)
    assert truth["truth_level_m"][-1] == pytest.approx(2.0 + height_m, abs=1e-9)
