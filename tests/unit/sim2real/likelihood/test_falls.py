"""Falls of a level while no pump runs."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.protocols.station.station_file import EffectTable
from wetwell.sim2real.likelihood.cells import cells_of
from wetwell.sim2real.likelihood.covariance import no_form
from wetwell.sim2real.likelihood.evidence import evidence_of_none
from wetwell.sim2real.likelihood.falls import Falls, falls_at_rest
from wetwell.sim2real.likelihood.flexible import flexible_factor
from wetwell.sim2real.recording.regimes import IDLE, STEADY, regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.residuals.bins import HEAD, NO_PUMP, Bins
from wetwell.sim2real.residuals.telemetry import Pattern
from wetwell.simulator.inflow.recorded import RecordedInflow
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

FOAM_M = 0.1
FOAM_S = 120
DRY_WEATHER = RecordedInflow(time_s=[0.0], flow_m3h=[12.0])


def recorded(station, *effects):
    acting = station.model_copy(update={"effect": tuple(EffectTable(**one) for one in effects)})
    scenario = Scenario(name="dry", inflow=DRY_WEATHER)
    traces = traces_of(Simulation(acting, scenario, 5, 0).advance(43_200, truth=False), station)
    return traces, regimes_of(traces, station)


def middles(regimes):
    """Second in the middle of each rest."""
    edges = np.flatnonzero(np.diff(regimes.of_station == IDLE, prepend=False, append=False))
    return [(begin + end) // 2 for begin, end in edges.reshape(-1, 2)]


def foaming(traces, seconds):
    level_m = traces.level_m.copy()
    for second in seconds:
        level_m[second : second + FOAM_S] += FOAM_M
    return replace(traces, level_m=level_m)


@pytest.mark.parametrize(
    "effects",
    [
        (),
        ({"name": "level_sensor_lag", "lag_s": 40.0},),
        ({"name": "channel_delay", "channel": "level_m", "delay_s": 20.0},),
        ({"name": "channel_delay", "channel": "frequency_hz", "delay_s": 20.0},),
        ({"name": "check_valve_leak", "leak_m3h": 10.0},),
        ({"name": "water_inertia", "inertia_s2_m2": 900.0},),
    ],
    ids=lambda effects: " ".join(str(value) for one in effects for value in one.values()) or "plain",
)
def test_no_level_of_the_library_falls_at_rest(alpha, effects):
    traces, regimes = recorded(alpha, *effects)
    falls = falls_at_rest(traces, alpha, regimes, ())
    assert falls.left_m.size > 10
    assert falls.left_m.max() < 3.0 * np.sqrt(falls.block.variance.max())


def test_a_level_that_foam_has_raised_falls_by_as_much_but_for_what_came_in(alpha):
    traces, regimes = recorded(alpha)
    seconds = middles(regimes)[2:5]
    plain, falls = (falls_at_rest(one, alpha, regimes, ()) for one in (traces, foaming(traces, seconds)))
    fell = np.flatnonzero(falls.left_m > plain.left_m + 0.01)
    assert fell.size == len(seconds)
    np.testing.assert_allclose(falls.left_m[fell], FOAM_M, atol=0.02)


def test_steps_of_the_level_are_no_falls(alpha):
    traces, regimes = recorded(alpha)
    one = Pattern(quantity="level_m", quantum=0.02)
    plain, coarse = (falls_at_rest(traces, alpha, regimes, patterns) for patterns in ((), (one,)))
    np.testing.assert_allclose(coarse.block.allowed**2, plain.block.allowed**2 + 0.02**2)


def test_rests_end_where_a_recording_ends(alpha):
    """What one recording ends with is no fall to what the next one begins with."""
    traces, regimes = recorded(alpha)
    second = middles(regimes)[3]
    level_m = np.where(np.arange(traces.seconds) >= second, traces.level_m - 0.3, traces.level_m)
    apart = replace(traces, level_m=level_m, part=(np.arange(traces.seconds) >= second).astype(np.int64))
    fallen, parted = (falls_at_rest(one, alpha, regimes, ()) for one in (replace(apart, part=traces.part), apart))
    assert fallen.left_m.max() > 0.25
    assert parted.left_m.max() < 0.02


def test_falls_let_something_unknown_act(alpha):
    ones = np.ones(240)
    bins = Bins(
        signal=np.full(240, HEAD),
        regime=np.full(240, STEADY),
        cycle=np.arange(240) // 4,
        pump=np.full(240, NO_PUMP),
        second=30 * np.arange(240),
        deviation=ones,
        floor=ones,
        tolerance=0.0 * ones,
        material=3.0 * ones,
    )
    cells = cells_of(bins, np.zeros(240, dtype=int), has_inflow=False, is_each_second=True)
    found = evidence_of_none(cells, np.random.default_rng(1).normal(size=cells.counts.size) * np.sqrt(cells.variance))
    traces, regimes = recorded(alpha)

    def factor(falls):
        return flexible_factor(found, no_form(cells), falls=falls)

    plain, foam = (falls_at_rest(one, alpha, regimes, ()) for one in (traces, foaming(traces, middles(regimes)[2:6])))
    assert isinstance(plain, Falls)
    assert factor(plain) < 0.0
    assert factor(foam) > 20.0


def test_only_a_fall_beyond_noise_and_what_is_allowed_is_told(alpha):
    traces, regimes = recorded(alpha)
    plain, foam = (falls_at_rest(one, alpha, regimes, ()) for one in (traces, foaming(traces, middles(regimes)[2:5])))
    assert plain.far_m == 0.0
    assert foam.far_m == pytest.approx(FOAM_M, abs=0.02)


def test_a_level_that_is_not_known_at_rest_falls_nowhere(alpha):
    traces, regimes = recorded(alpha)
    nothing = replace(traces, level_m=np.full(traces.seconds, np.nan))
    assert falls_at_rest(nothing, alpha, regimes, ()) is None
