"""What readings of an inflow in rows say of the time between them, against the inflow that was put in."""

from dataclasses import replace

import numpy as np
import pytest
from statsmodels.tsa.statespace.structural import UnobservedComponents

from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.metered_inflow import metered_inflow
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

SECONDS = 86_400
EVERY = 60


@pytest.fixture(scope="module")
def made(quiet_alpha):
    return replace(
        Simulation(quiet_alpha, Scenario(name="h", initial_level_m=1.5), seed=4).advance(SECONDS), truth={}
    )


def traces_with(made, station, inflow_m3h, every=EVERY, value="instant"):
    rows = slice(every - 1, None, every)
    columns = {name: column[rows] for name, column in (made.columns | {"inflow_m3h": inflow_m3h}).items()}
    return traces_of(replace(made, time_ns=made.time_ns[rows], columns=columns, value=value), station)


def walk(seed, step_m3h=0.4):
    return 100.0 + np.cumsum(np.random.default_rng(seed).normal(0.0, step_m3h, SECONDS))


def readings(seed, error_m3h):
    return walk(seed) + np.random.default_rng([1, seed]).normal(0.0, error_m3h, SECONDS)


@pytest.mark.parametrize("error_m3h", [10.0, 40.0])
def test_its_error_is_as_large_and_as_slow_as_it_says(made, quiet_alpha, error_m3h):
    """Of days that differ, off what came in: its size, and how alike it is from row to row."""
    rows = np.arange(0, SECONDS - EVERY + 1, EVERY)
    off, said = [], []
    for seed in range(6):
        found = metered_inflow(traces_with(made, quiet_alpha, readings(seed, error_m3h)))
        off.append((found.course_m3h - walk(seed)[EVERY - 1 :])[rows])
        said.append((found.error_m3h, found.kept**EVERY))
    error_said_m3h, alike_said = np.median(said, axis=0)
    assert np.sqrt(np.mean(np.square(off))) == pytest.approx(error_said_m3h, rel=0.15)
    alike = np.mean([np.corrcoef(one[1:], one[:-1])[0, 1] for one in off])
    assert alike == pytest.approx(alike_said, abs=0.06)
    assert error_said_m3h < 0.8 * error_m3h


def test_the_course_is_that_of_statsmodels(made, quiet_alpha):
    traces = traces_with(made, quiet_alpha, readings(1, 40.0))
    values = traces.inflow_m3h[traces.is_row]
    fitted = UnobservedComponents(values, "local level").fit(disp=False)
    found = metered_inflow(traces)
    off = found.course_m3h[traces.is_row] - fitted.smoothed_state[0]
    assert np.std(off[60:-60]) < 0.1 * np.std(values - fitted.smoothed_state[0])
    steady = np.sqrt(fitted.smoothed_state_cov[0, 0, values.size // 2])
    assert found.error_m3h == pytest.approx(steady, rel=0.1)


def test_an_inflow_that_moves_much_from_row_to_row_is_taken_as_it_was_read(made, quiet_alpha):
    traces = traces_with(made, quiet_alpha, walk(2, 10.0))
    found = metered_inflow(traces)
    assert found.error_m3h < 0.2 * found.between_m3h
    assert found.between_m3h == pytest.approx(10.0 * np.sqrt(EVERY / 12.0), rel=0.1)
    assert np.std(found.course_m3h - traces.inflow_m3h) < 0.1 * np.std(np.diff(traces.inflow_m3h[traces.is_row]))


def test_means_are_what_came_in_and_each_second_is_as_it_was_read(made, quiet_alpha):
    for every, value in ((EVERY, "mean"), (1, "instant")):
        traces = traces_with(made, quiet_alpha, readings(3, 40.0), every, value)
        found = metered_inflow(traces)
        assert found.course_m3h is traces.inflow_m3h
        assert found.error_m3h == 0.0
    assert metered_inflow(replace(traces, inflow_m3h=None)) is None
