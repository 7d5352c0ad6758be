"""Residuals of plants that are not ours, under the true model, are as large as the likelihood expects them."""

import numpy as np
import pytest

from wetwell.services.trial.material_case import material_case
from wetwell.sim2real.likelihood.cells import cells_of
from wetwell.sim2real.likelihood.covariance import expected_squares
from wetwell.sim2real.recording.regimes import MULTI_PUMP, REGIMES, STEADY, regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.bins import LEVEL, SIGNALS
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.sim2real.trial.cases import StoragePlan, trial_case

SEED = 970_900
SECONDS = 28_800
STEADILY = (0.15, 1.4)
"""Mean square of flow, head and power while one pump runs steadily."""
SEVERAL = (0.15, 2.7)
"""The same of several pumps."""
MOST_OF_LEVEL = 1.6
"""Mean square of the level in rows of up to ten seconds: rain fills slower ones faster (docs/likelihood.md)."""
RAINY = 0.1
"""Share of the cycles in which it may rain."""


def left_and_cells(plant, every_s, metered_share):
    """Means of what the true model leaves, and their cells."""
    storage = StoragePlan(rates_s=(every_s,), metered_share=metered_share)
    case = trial_case(SEED, 0, kinds=("none",), plants=(plant,), seconds=SECONDS, storage=storage)
    _, truth, recording = material_case(case)
    traces = traces_of(recording, truth.station)
    regimes, replay = regimes_of(traces, truth.station), Replay(traces, truth.station)
    prediction = replay.run()
    residuals = StationResiduals(traces, truth.station, regimes, prediction, replay.doubt)
    cells = cells_of(residuals.bins, np.zeros(residuals.bins.size, dtype=int), has_inflow=True, is_each_second=True)
    return cells.means(residuals.of(prediction)), cells


@pytest.mark.parametrize("metered_share", [0.0, 1.0], ids=["without inflow", "metered"])
@pytest.mark.parametrize(
    ("plant", "every_s"), [("fine", 1), ("fine", 10), ("fine", 60), ("elastic", 10), ("elastic", 60)]
)
def test_the_true_model_leaves_what_is_expected(plant, every_s, metered_share):
    left, cells = left_and_cells(plant, every_s, metered_share)
    limits = {STEADY: STEADILY, MULTI_PUMP: SEVERAL}
    steady = 0
    for block in cells.blocks:
        name = (SIGNALS[block.signal], REGIMES[block.regime])
        squares = left[block.rows] ** 2 / expected_squares(block)
        square = float(np.mean(squares))
        if block.signal < LEVEL and block.regime in limits:
            least, most = limits[block.regime]
            assert least < square < most, name
            steady += 1
        elif block.signal == LEVEL and every_s <= 10:
            cycles, cycle = np.unique(block.cycle, return_inverse=True)
            of_cycles = np.sort(np.bincount(cycle, squares) / np.bincount(cycle))
            assert np.mean(of_cycles[: cycles.size - round(RAINY * cycles.size)]) < MOST_OF_LEVEL, name
    assert steady == 6


@pytest.mark.parametrize("metered_share", [0.0, 1.0], ids=["without inflow", "metered"])
@pytest.mark.parametrize("plant", ["fine", "elastic"])
def test_what_is_allowed_of_a_level_says_nothing_of_its_error(plant, metered_share):
    """Rows of a minute hide inflow and switches. What the filter corrects by them is their error, not what moves."""
    left, cells = left_and_cells(plant, 60, metered_share)
    looked_at = 0
    for rows in (one.rows for one in cells.blocks if one.signal == LEVEL and one.rows.size > 20):
        assert abs(float(np.corrcoef(np.abs(left[rows]), cells.allowed[rows])[0, 1])) < 0.6
        looked_at += 1
    assert looked_at >= 4
