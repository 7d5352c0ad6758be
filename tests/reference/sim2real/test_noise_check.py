"""Residuals of plants that are not ours, under the true model, are as large as the noise model says."""

import numpy as np
import pytest

from wetwell.services.trial.acting_case import acting_case
from wetwell.sim2real.recording.regimes import MULTI_PUMP, REGIMES, STEADY, regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.bins import LEVEL, SIGNALS
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.sim2real.trial.cases import StoragePlan, trial_case

SEED = 970_900
SECONDS = 28_800
MOST, LEAST = 2.3, 0.15
"""Mean square of flow, head and power in a regime; the least while a pump runs steadily."""
MOST_OF_LEVEL = 1.6
"""Mean square of the level, in rows of a second: slower ones are off by more on some plants (docs/likelihood.md)."""


@pytest.mark.parametrize("metered_share", [0.0, 1.0], ids=["without inflow", "metered"])
@pytest.mark.parametrize(
    ("plant", "every_s"), [("fine", 1), ("fine", 10), ("fine", 60), ("elastic", 10), ("elastic", 60)]
)
def test_the_true_model_leaves_what_the_noise_model_says(plant, every_s, metered_share):
    storage = StoragePlan(rates_s=(every_s,), metered_share=metered_share)
    case = trial_case(SEED, 0, kinds=("none",), plants=(plant,), seconds=SECONDS, storage=storage)
    _, truth, recording = acting_case(case)
    traces = traces_of(recording, truth.station)
    regimes, replay = regimes_of(traces, truth.station), Replay(traces, truth.station)
    prediction = replay.run()
    residuals = StationResiduals(traces, truth.station, regimes, prediction, replay.doubt())
    squares = residuals.of(prediction) ** 2
    cells = list(residuals.bins.cells(np.ones(squares.size, dtype=bool)))
    assert len(cells) >= 3
    for signal, regime, cell in cells:
        name = (SIGNALS[signal], REGIMES[regime])
        if signal < LEVEL or every_s == 1:
            assert squares[cell].mean() < (MOST if signal < LEVEL else MOST_OF_LEVEL), name
        if signal < LEVEL and regime in (STEADY, MULTI_PUMP):
            assert squares[cell].mean() > LEAST, name
