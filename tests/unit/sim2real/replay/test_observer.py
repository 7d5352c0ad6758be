"""How recorded levels move the replay."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from wetwell.protocols.quantities import LEVEL
from wetwell.sim2real.recording.by_hand import left_alone
from wetwell.sim2real.recording.drives import Drives
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.inflow_process import InflowProcess
from wetwell.sim2real.replay.metered_inflow import metered_inflow
from wetwell.sim2real.replay.observer import (
    constant_observer,
    forced_observer,
    hides_cycles,
    row_observer,
    uncertain_of,
)
from wetwell.simulator.parameters import plant_parameters
from wetwell.simulator.telemetry.damping import damped_by

SECONDS = 7200


def observer_of(traces, station, **process):
    uncertain = replace(uncertain_of(traces, station, metered_inflow(traces), traces.level_m), **process)
    process = InflowProcess(lags_s=(0.0,), under=(uncertain,))
    return row_observer(traces.level_m, process, plant_parameters(station).sensors[LEVEL])


@pytest.fixture
def traces(alpha):
    """Rows of a minute; one start whose moment is open."""
    pumps = len(alpha.pump)
    is_row = np.arange(SECONDS) % 60 == 0
    level_m = np.where(is_row, 1.0 + 0.3 * np.sin(np.arange(SECONDS) / 900.0), np.nan)
    open_s = np.zeros((pumps, SECONDS))
    open_s[0, 3600] = 50.0
    return Traces(
        start_ns=0,
        rate_s=60.0,
        value="instant",
        time_s=np.arange(SECONDS, dtype=float),
        is_row=is_row,
        drives=Drives(frequency_hz=np.zeros((pumps, SECONDS)), placements=(), open_s=open_s),
        level_m=level_m,
        inflow_m3h=np.full(SECONDS, 100.0),
        signals={},
        by_hand=left_alone(SECONDS),
        part=np.zeros(SECONDS, dtype=int),
    )


def test_a_level_of_each_second_is_followed_slowly_and_begun_anew_after_a_pause():
    level_m = np.ones(1000)
    level_m[100:110] = level_m[200:600] = np.nan
    observer = constant_observer(level_m)
    assert observer.level_gain[50] == pytest.approx(1.0 / 150.0)
    assert observer.level_gain[110] == pytest.approx(11.0 / 150.0)
    assert observer.level_gain[600] == 1.0
    assert not observer.inflow_gain.any()


def test_after_a_start_whose_moment_is_open_the_level_is_taken_from_the_row_and_nobody_is_blamed(alpha, traces):
    observer = observer_of(traces, alpha)
    carried_m = 50.0 * 3600.0**-1 / alpha.sump.area_m2
    assert observer.deviation_m[3600] > 10.0 * observer.deviation_m[3540] > 0.1 * carried_m
    assert observer.level_gain[3600] > 0.99 > observer.level_gain[3540]


def test_by_the_next_row_a_sensor_that_lags_has_told_of_most_that_a_start_may_hide(alpha, traces):
    """The level would swing from row to row if it had to be behind a sensor that knew of none of it."""
    observer = observer_of(traces, alpha)
    lagging = observer.of_lagging_level(damped_by(plant_parameters(alpha).sensors[LEVEL], 3.0, 0.0))
    assert lagging.level_gain[3600] == pytest.approx(1.0, abs=0.05)
    assert lagging.deviation_m[3600] == pytest.approx(observer.deviation_m[3600], rel=0.1)


def test_what_a_start_may_hide_goes_by_the_flow_that_is_recorded(alpha, traces):
    pumps = len(alpha.pump)
    frequency_hz = np.where(np.arange(SECONDS) >= 3600, 50.0, 0.0) * np.eye(pumps)[0][:, None]
    running = replace(traces, drives=replace(traces.drives, frequency_hz=frequency_hz))
    rated, half = (
        observer_of(one, alpha).deviation_m[3600]
        for one in (running, replace(running, signals={"flow_m3h": np.where(frequency_hz > 0.0, 50.0, np.nan)}))
    )
    assert half == pytest.approx(50.0 / 3600.0 * 50.0 / alpha.sump.area_m2 / np.sqrt(12.0), rel=0.05)
    assert half < 0.5 * rated


def test_an_inflow_that_is_not_measured_is_followed_but_for_what_a_start_may_hide(alpha, traces):
    observer = observer_of(replace(traces, inflow_m3h=None), alpha, drift_m2_s3=1e-12)
    assert observer.inflow_gain[3540] > 0.0
    assert observer.inflow_gain[3600] < 0.1 * observer.inflow_gain[3540]
    assert np.all(observer.deviation_m[3660:3780:60] >= observer.deviation_m[3540])


def test_where_the_well_is_emptied_between_rows_the_level_is_taken_from_them(alpha, traces):
    assert not hides_cycles(traces, alpha)
    small = alpha.model_copy(update={"sump": alpha.sump.model_copy(update={"area_m2": 1.0})})
    assert hides_cycles(traces, small)
    observer = forced_observer(traces)
    assert observer.level_m[30] == pytest.approx(0.5 * (traces.level_m[0] + traces.level_m[60]))
    assert np.isinf(observer.deviation_m).all()


@pytest.mark.parametrize("kept", [1.0, 0.9])
def test_what_an_error_leaves_follows_from_the_gains(kept):
    """Against scipy's state space: gains of each second that do not change."""
    rng = np.random.default_rng(3)
    gain, of_inflow = 0.1, 0.004
    observer = replace(
        constant_observer(np.ones(400)),
        level_gain=np.full(400, gain),
        inflow_gain=np.full(400, of_inflow),
        inflow_kept=kept,
    )
    gained_m, misread_m = rng.normal(size=(2, 400))
    matrices = (
        np.array([[1.0 - gain, 1.0 - gain], [-of_inflow, kept - of_inflow]]),
        np.array([[1.0 - gain, -gain], [-of_inflow, -of_inflow]]),
        np.array([[1.0, 1.0]]),
        np.array([[1.0, 1.0]]),
    )
    _, expected, _ = signal.dlsim((*matrices, 1.0), np.column_stack([gained_m, misread_m]))
    assert observer.left_m(gained_m, misread_m) == pytest.approx(expected[:, 0], abs=1e-9)


def test_what_does_not_change_is_taken_for_inflow():
    observer = replace(constant_observer(np.ones(4000)), inflow_gain=np.full(4000, 1e-4))
    left_m = observer.left_m(np.full(4000, 1e-3), np.full(4000, 0.05))
    assert np.max(np.abs(left_m)) > 0.05
    assert np.max(np.abs(left_m[-100:])) < 1e-6


def test_between_values_it_goes_wrong_as_the_balance_does():
    level_m = np.where(np.arange(40) % 10 == 0, 1.0, np.nan)
    left_m = constant_observer(level_m).left_m(np.full(40, 1e-3), np.zeros(40))
    assert np.diff(left_m)[21:30] == pytest.approx(1e-3)
    assert left_m[31] < left_m[30]
