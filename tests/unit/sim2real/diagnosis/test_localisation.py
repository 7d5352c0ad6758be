"""Which component a gap points to, from how its residuals move."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.sim2real.diagnosis.localisation import localise
from wetwell.sim2real.diagnosis.shrinkage import excess_that_matters
from wetwell.sim2real.recording.regimes import START_RAMP, STEADY, STOP_RAMP
from wetwell.sim2real.residuals.bins import FLOW, HEAD, LEVEL, POWER, START_LEVEL, STOP_LEVEL, Bins, joined
from wetwell.simulator.parameters import plant_parameters

RUNS, BINS_PER_RUN = 40, 20
HEAD_DEVIATION = 0.05


def bins_of(signals, regime):
    """Bins of twenty seconds, `BINS_PER_RUN` a run, of one pump; (bins,) second and place in the run."""
    count = RUNS * BINS_PER_RUN
    second = np.tile(20 * np.arange(count) + 600 * np.repeat(np.arange(RUNS), BINS_PER_RUN), len(signals))
    size = second.size
    return Bins(
        signal=np.repeat(signals, count),
        regime=np.full(size, regime),
        cycle=np.tile(np.repeat(np.arange(RUNS), BINS_PER_RUN), len(signals)),
        pump=np.zeros(size, dtype=np.int64),
        second=second,
        deviation=np.where(np.repeat(signals, count) == HEAD, HEAD_DEVIATION, 1.0),
        floor=np.zeros(size),
        tolerance=np.zeros(size),
        material=np.zeros(size),
    )


def blamed(residuals, bins, station, patterns=None):
    return localise(residuals**2, residuals, bins, plant_parameters(station), patterns or {})


def test_power_that_runs_away_is_its_meter_and_power_that_swings_the_drive(alpha):
    bins = bins_of([POWER], STEADY)
    turn = np.linspace(0.0, 1.0, bins.size)
    assert blamed(10.0 * turn, bins, alpha) == "power_meter"
    assert blamed(10.0 * np.sin(2.0 * np.pi * turn), bins, alpha) == "drive"


@pytest.mark.parametrize(
    ("share", "component"), [(1.0, "power_meter"), (0.9, "power_meter"), (0.125, "drive"), (0.0, "drive")]
)
def test_a_power_that_is_as_wrong_before_half_speed_as_at_speed_is_its_meter(alpha, share, component):
    running = bins_of([POWER], STEADY)
    place = np.arange(running.size) % BINS_PER_RUN
    starting = replace(running, regime=np.full(running.size, START_RAMP), second=600 * running.cycle + place)
    swing = 10.0 * np.sin(2.0 * np.pi * running.cycle / RUNS)
    of_start = np.where(place < alpha.control.ramp_s / 2.0, share, 0.125) * swing
    assert blamed(np.r_[swing, of_start], joined([running, starting]), alpha) == component
    assert blamed(swing, running, alpha) == "drive"


@pytest.mark.parametrize(("period_s", "component"), [(60.0, "drive"), (4000.0, "pump")])
def test_a_speed_that_swings_within_a_run_is_the_drive(alpha, period_s, component):
    bins = bins_of([FLOW, HEAD], STEADY)
    swing = 10.0 * np.sin(2.0 * np.pi * bins.second / period_s)
    plant = plant_parameters(alpha)
    along = 2.0 * plant.mains[0].friction_h2_m5 * float(plant.rated_flow_m3h[0]) / HEAD_DEVIATION
    assert blamed(np.where(bins.signal == FLOW, swing, along * swing), bins, alpha) == component


@pytest.mark.parametrize(
    ("signal", "growth", "component"),
    [
        (FLOW, 1.0, "telemetry"),
        (FLOW, 0.0, "flow_meter"),
        (HEAD, 1.0, "telemetry"),
        (HEAD, 0.0, "head_sensor"),
    ],
)
def test_what_is_ever_later_at_starts_alone_is_telemetry(alpha, signal, growth, component):
    """Where the flow ends with the pump, its head tells nothing of stops."""
    bins = bins_of([FLOW, HEAD], START_RAMP)
    turn = bins.second / bins.second.max()
    late = np.where(bins.signal == signal, -20.0 * (growth * turn + (1.0 - growth)), 0.0)
    assert blamed(late, bins, alpha) == component


@pytest.mark.parametrize(
    ("signal", "at_stops", "component"),
    [(HEAD, 1.0, "telemetry"), (HEAD, -1.0, "head_sensor"), (POWER, 1.0, "telemetry"), (POWER, -1.0, "drive")],
)
def test_what_is_late_is_too_low_at_starts_and_too_high_at_stops(alpha, signal, at_stops, component):
    """A power or a head that goes otherwise with the frequency is off to the same side in both."""
    bins = bins_of([FLOW, signal], START_RAMP)
    bins = replace(bins, regime=np.where(np.arange(bins.size) % 2 == 0, START_RAMP, STOP_RAMP))
    size = np.where(bins.regime == START_RAMP, -10.0, 10.0 * at_stops)
    assert blamed(np.where(bins.signal == signal, size, 0.0), bins, alpha) == component


def test_a_clock_that_is_set_at_times_is_telemetry(alpha):
    bins = bins_of([FLOW, HEAD], START_RAMP)
    late = -2.0 * (bins.cycle % 15) / 15.0
    assert blamed(np.where(bins.signal == FLOW, late, 0.0), bins, alpha) == "telemetry"


@pytest.mark.parametrize("is_calm", [True, False])
@pytest.mark.parametrize(("at_starts", "component"), [(8.0, "level_sensor"), (0.5, "sump")])
def test_a_level_that_follows_slowly_shows_in_starts_and_in_stops(alpha, at_starts, component, is_calm):
    """Another area at the bottom shows at stops alone, though an inflow that nobody measures takes it up at once."""
    bins = bins_of([LEVEL], STEADY)
    place = np.arange(bins.size) % BINS_PER_RUN
    bins = replace(bins, regime=np.select([place == 0, place == 10], [START_RAMP, STOP_RAMP], STEADY))
    between = np.full(bins.size, 2.0) if is_calm else np.random.default_rng(3).normal(0.0, 2.0, bins.size)
    size = np.select([place == 0, place == 10], [at_starts, 8.0], between)
    assert blamed(size, bins, alpha) == component


def test_a_flow_that_departs_at_random_in_ramps_does_not_run_late(alpha):
    """A few large ones at the end make most of the gap there; they are on both sides."""
    bins = bins_of([FLOW, HEAD], START_RAMP)
    turn = bins.second / bins.second.max()
    swing = np.random.default_rng(5).normal(0.0, 10.0, bins.size) * turn**2
    assert blamed(np.where(bins.signal == FLOW, swing, 0.0), bins, alpha) != "telemetry"


@pytest.mark.parametrize(
    ("signals", "patterns", "component"),
    [
        ([HEAD], {"head_m": "telemetry"}, "telemetry"),
        ([HEAD], {"flow_m3h": "telemetry"}, "head_sensor"),
        ([FLOW, HEAD], {"head_m": "telemetry"}, "pump"),
        ([LEVEL, START_LEVEL], {"level_m": "level_sensor"}, "level_sensor"),
    ],
)
def test_a_channel_that_departs_alone_and_has_a_pattern_is_what_makes_it(alpha, signals, patterns, component):
    """What a held head is off follows from its being held; where the flow is off too, something else is."""
    bins = bins_of([FLOW, HEAD, LEVEL, START_LEVEL], STEADY)
    residuals = np.where(np.isin(bins.signal, signals), 5.0, 0.0)
    assert blamed(residuals, bins, alpha, patterns) == component


@pytest.mark.parametrize(("sign", "component"), [(-1.0, "telemetry"), (1.0, "controller")])
def test_a_level_that_is_ever_later_is_too_low_at_starts_and_too_high_at_stops(alpha, sign, component):
    bins = bins_of([LEVEL, START_LEVEL, STOP_LEVEL], START_RAMP)
    turn = bins.second / bins.second.max()
    size = np.select([bins.signal == START_LEVEL, bins.signal == STOP_LEVEL], [sign * 10.0, 10.0], 1.0)
    assert blamed(size * turn, bins, alpha) == component


@pytest.mark.parametrize(
    ("at_starts", "in_ramps", "component"),
    [
        pytest.param(-5.0, 5.0, "telemetry", id="it comes late"),
        pytest.param(0.0, 5.0, "level_sensor", id="its sensor follows slowly, and the controller goes by that"),
        pytest.param(-5.0, 0.0, "controller", id="pumps start and stop at other levels"),
    ],
)
def test_a_level_that_is_late_as_it_may_is_too_low_where_pumps_start(alpha, at_starts, in_ramps, component):
    bins = bins_of([LEVEL, START_LEVEL, STOP_LEVEL], STEADY)
    place, is_level = np.arange(bins.size) % BINS_PER_RUN, bins.signal == LEVEL
    regime = np.select([is_level & (place < 5), is_level & (place >= 15)], [START_RAMP, STOP_RAMP], STEADY)
    bins = replace(bins, regime=regime)
    turn = np.random.default_rng(7).uniform(0.5, 1.5, bins.size)  # a clock that is set at times
    size = np.select([bins.signal == START_LEVEL, bins.signal == STOP_LEVEL], [at_starts, -at_starts], in_ramps)
    assert blamed(turn * np.where(is_level & (regime == STEADY), 0.0, size), bins, alpha) == component


@pytest.mark.parametrize(("lasting", "component"), [(True, "sump"), (False, "level_sensor")])
def test_a_level_that_wanders_is_its_sensor_and_a_balance_that_stays_open_the_sump(alpha, lasting, component):
    bins = bins_of([LEVEL], STEADY)
    rng = np.random.default_rng(3)
    since_s = bins.second - np.repeat(bins.second[::BINS_PER_RUN], BINS_PER_RUN)
    open_balance = 6.0 * (1.0 - np.exp(-since_s / 150.0))
    assert blamed(open_balance if lasting else rng.normal(0.0, 5.0, bins.size), bins, alpha) == component


def test_flow_that_comes_late_at_starts_alone_is_the_check_valve(alpha):
    bins = bins_of([FLOW, HEAD], START_RAMP)
    plant = plant_parameters(alpha)
    _, c1, c2 = plant.curves[0]
    on_curve = (c1 + 2.0 * c2 * float(plant.rated_flow_m3h[0])) / HEAD_DEVIATION
    assert blamed(np.where(bins.signal == FLOW, -10.0, -10.0 * on_curve), bins, alpha) == "pump"


def readings_ahead(starts, stops):
    """Flow, head, power and levels of switches, by what they are off at starts and at stops."""
    parts, residuals = [], []
    for regime, sizes in ((START_RAMP, starts), (STOP_RAMP, stops)):
        at_switch = START_LEVEL if regime == START_RAMP else STOP_LEVEL
        for signal, size in zip((FLOW, HEAD, POWER, at_switch), sizes, strict=True):
            parts.append(bins_of([signal], regime))
            residuals.append(np.full(parts[-1].size, size))
    return np.concatenate(residuals), joined(parts)


@pytest.mark.parametrize(
    ("starts", "stops", "component"),
    [
        ((8.0, 8.0, 8.0, 2.0), (-8.0, -8.0, -8.0, -2.0), "telemetry"),
        ((8.0, 8.0, 8.0, -2.0), (-8.0, -8.0, -8.0, -2.0), "drive"),
        ((8.0, 8.0, 8.0, 2.0), (8.0, -8.0, -8.0, -2.0), "drive"),
        ((0.2, 0.2, 0.2, 8.0), (-0.2, -0.2, -0.2, -8.0), "controller"),
    ],
)
def test_readings_that_all_come_before_their_frequency_are_telemetry(alpha, starts, stops, component):
    """A shorter ramp moves no level of a switch, and a late controller no flow."""
    residuals, bins = readings_ahead(starts, stops)
    assert blamed(residuals, bins, alpha) == component


def test_a_stop_level_is_not_outweighed_by_ramps_that_are_off_by_less_than_is_allowed():
    ramps, stops = bins_of([FLOW, HEAD, POWER, LEVEL], STOP_RAMP), bins_of([STOP_LEVEL], STEADY)
    bins = joined([replace(ramps, material=np.ones(ramps.size)), stops])
    ramps_off = np.where(np.arange(bins.size) < ramps.size, 0.9, 2.0)
    excess = excess_that_matters(ramps_off, np.ones(bins.size, dtype=np.bool_), bins)
    assert set(np.unique(bins.signal[excess > 0.0])) == {STOP_LEVEL}
    assert excess[-1] == 4.0
    hardly = np.full(bins.size, 0.3)
    assert np.all(excess_that_matters(hardly, bins.signal == FLOW, bins)[bins.signal == FLOW] == pytest.approx(0.09))
