"""A level that is rounded is known when it changes: it is midway then."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.sim2real.recording.regimes import regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay, steps_m
from wetwell.sim2real.residuals.bins import LEVEL
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

FROM_S = 3_600
"""The observer knows the inflow from then on."""


@pytest.mark.parametrize(
    ("is_metered", "quantum_m", "most"),
    [(True, 0.015, 1.2), (True, 0.06, 1.0), (False, 0.015, 0.8), (False, 0.06, 0.5)],
)
def test_by_its_steps_a_rounded_level_is_followed_closer_than_by_its_values(alpha, is_metered, quantum_m, most):
    """With an inflow meter either does: steps of all seconds average out."""
    rounding = EFFECTS["level_quantisation"](quantum_m=quantum_m)
    station = alpha.model_copy(update={"effect": (rounding,)})
    recording = Simulation(station, Scenario(name="plain"), 7, 0).advance(43_200)
    traces = traces_of(recording, alpha)
    replay = Replay(traces if is_metered else replace(traces, inflow_m3h=None), alpha)
    true_m = recording.truth["truth_level_m"][FROM_S:]
    by_steps_m, by_values_m = (
        np.sqrt(np.mean((replay.run(effects).level_m[FROM_S:] - true_m) ** 2)) for effects in ((rounding,), ())
    )
    assert by_steps_m < most * by_values_m


def test_a_level_in_steps_counts_where_it_changes_and_midway(alpha):
    rounding = EFFECTS["level_quantisation"](quantum_m=0.02)
    station = alpha.model_copy(update={"effect": (rounding,)})
    traces = replace(
        traces_of(Simulation(station, Scenario(name="plain"), 7, 0).advance(21_600, truth=False), alpha),
        inflow_m3h=None,
    )
    replay, regimes = Replay(traces, alpha), regimes_of(traces, alpha)
    residuals = StationResiduals(traces, alpha, regimes, replay.run(), replay.doubt)
    bins = residuals.bins
    its = bins.signal == LEVEL
    is_step = np.isfinite(steps_m(traces.level_m))
    assert is_step[bins.second[its]].all()
    left = residuals.of(replay.run([rounding]))[its]
    assert 0.3 < np.sqrt(np.mean(left**2)) < 1.2
