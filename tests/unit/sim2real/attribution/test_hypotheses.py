"""Sets of effects as hypotheses: fitted where they weigh most, and tried where their parts stand."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.protocols.station.station_file import EffectTable
from wetwell.sim2real.attribution.candidates import candidates_of
from wetwell.sim2real.attribution.fit.fitting import Fitter
from wetwell.sim2real.attribution.fit.refining import refined
from wetwell.sim2real.attribution.hypotheses import Hypotheses
from wetwell.sim2real.likelihood.cells import cells_of
from wetwell.sim2real.recording.regimes import regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

TRUTH = (EFFECTS["flow_meter_lag"](lag_s=20.0, second_share=0.5), EFFECTS["static_head_bias"](offset_m=1.5))


@pytest.fixture(scope="module")
def fitter(alpha):
    station = alpha.model_copy(
        update={"effect": tuple(EffectTable.model_validate(one.model_dump()) for one in TRUTH)}
    )
    traces = traces_of(Simulation(station, Scenario(name="plain"), 5, 0).advance(14_400), alpha)
    regimes = regimes_of(traces, alpha)
    replay = Replay(traces, alpha)
    residuals = StationResiduals(traces, alpha, regimes, replay.run(), replay.doubt())
    return Fitter(replay, residuals, residuals.bins.cycle % 2 == 0)


@pytest.fixture(scope="module")
def cells(fitter):
    bins = fitter.bins
    return cells_of(bins, np.zeros(bins.size, dtype=int), has_inflow=True, is_each_second=True)


@pytest.fixture
def hypotheses(fitter, cells):
    return Hypotheses(fitter, cells, map)


@pytest.fixture(scope="module")
def lag(alpha):
    (one,) = candidates_of(len(alpha.pump), 1, only=["flow_meter_lag"])
    return replace(one, free=one.free[:1])


@pytest.fixture(scope="module")
def lift(alpha):
    return candidates_of(len(alpha.pump), 1, only=["static_head_bias"])[0]


BOTH = ("flow_meter_lag", "static_head_bias")


def test_a_set_is_weighed_where_it_weighs_most(fitter, cells, lag, lift):
    """Wherever it was fitted before: slopes that reach too far say nothing."""
    far = fitter.at([lag, lift], [np.array([0.2]), np.array([0.42])])
    found = []
    for start in (far, refined(fitter, far)):
        hypotheses = Hypotheses(fitter, cells, map)
        hypotheses.add([start])
        found.append(hypotheses.of(BOTH))
        assert np.abs(found[-1].evidence.step).max() < 0.002
    assert found[0].evidence.log == pytest.approx(found[1].evidence.log, abs=1.0)
    np.testing.assert_allclose(found[0].fit.position, found[1].fit.position, atol=0.003)


def test_a_set_is_tried_where_its_parts_stand(fitter, hypotheses, lag, lift, monkeypatch):
    """Each minimum of a sum of squares keeps what is near it: here nothing leads from one to the other."""
    monkeypatch.setattr("wetwell.sim2real.attribution.hypotheses.REFITS", 0)
    hypotheses.add([refined(fitter, fitter.at([lag], [np.array([0.16])]))])
    hypotheses.add([fitter.at([lag, lift], [np.array([0.2]), np.array([0.38])])])
    np.testing.assert_array_equal(hypotheses.of(BOTH).fit.points[0], hypotheses.of(BOTH[:1]).fit.points[0])


def test_a_part_is_tried_where_it_stands_in_the_best_set(fitter, hypotheses, lag, lift, monkeypatch):
    """Else a set of more effects may be likelier for its place alone."""
    monkeypatch.setattr("wetwell.sim2real.attribution.hypotheses.REFITS", 0)
    hypotheses.add([fitter.at([lag], [np.array([0.2])])])
    hypotheses.add([refined(fitter, fitter.at([lag, lift], [np.array([0.16]), np.array([0.38])]))])
    np.testing.assert_array_equal(hypotheses.of(BOTH[:1]).fit.points[0], hypotheses.of(BOTH).fit.points[0])
