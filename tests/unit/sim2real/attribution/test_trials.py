"""Trials of a further effect beside others."""

import numpy as np
import pytest

from wetwell.sim2real.attribution.attribution import halves, weighed_cells
from wetwell.sim2real.attribution.candidates import candidates_of
from wetwell.sim2real.attribution.fitting import Fitter
from wetwell.sim2real.attribution.hypotheses import Hypotheses
from wetwell.sim2real.attribution.initial_guess import initial_guesses
from wetwell.sim2real.attribution.trials import Trials
from wetwell.sim2real.recording.regimes import regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.asinh_loss import residuals_of
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.sim2real.trial.cases import trial_case
from wetwell.sim2real.truth import truth_plant


@pytest.mark.check
def test_a_limit_that_leads_astray_beside_a_header_is_tried_from_another_start():
    """Four pumps share a main, so that each moves little, and its meter reads 0 under 30 m³/h.

    As if all were linear, a limit of 60 m³/h and no header would do; it leaves more than the header alone.
    """
    case = trial_case(1_003_001, 1, kinds=("single", "pair"), plants=("fine",), seconds=86_400)
    truth = case.truth()
    assert case.names == ("common_header", "flow_low_cutoff")
    traces = traces_of(truth_plant.run(truth), truth.station)
    regimes, replay = regimes_of(traces, truth.station), Replay(traces, truth.station)
    residuals = StationResiduals(traces, truth.station, regimes, replay.run(), replay.doubt())
    fitter = Fitter(replay, residuals, halves(residuals.bins, traces.pumps)[0])
    header, cutoff = (
        candidates_of(traces.pumps, len(truth.station.mains), only=[name])[0]
        for name in ("common_header", "flow_low_cutoff")
    )
    guesses = {one: initial_guesses(one, replay, residuals, fitter.plain.residuals) for one in (header, cutoff)}
    alone = fitter.refine(fitter.at([header], [np.array([0.8])]))
    cells = weighed_cells(replay, residuals, residuals_of(fitter.plain.residuals))
    besides = Hypotheses(fitter, cells, map).beside([alone])
    (both,) = Trials(fitter, cells, guesses, lambda _: None, map).with_one_more([alone], besides)
    assert both.names == ("common_header", "flow_low_cutoff")
    assert fitter.cost(both) < 0.5 * fitter.cost(alone)
    (limit,) = (effect for effect in both.effects if effect.name == "flow_low_cutoff")
    assert limit.cutoff_m3h == pytest.approx(truth.deviations[1].parameters["cutoff_m3h"], rel=0.06)
