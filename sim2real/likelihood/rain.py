"""Rain: cycles in which an inflow without a meter moves much faster than while it is dry."""

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.likelihood.cells import Block
from wetwell.sim2real.likelihood.covariance import expected_squares
from wetwell.sim2real.likelihood.ways import POORLY

RAIN = 30.0
"""Variance that rain adds to the level, over what the drift of the inflow at rest makes of it. [1]"""


def rainy_cells(block: Block, residuals: Floats) -> tuple[Flags, float]:
    r"""Where it rains, most probably, and what not knowing it adds to the logarithm of the probability.

    $$\sum_c \ln\left((1 - p)\,p(r_c \mid \text{dry}) + p\,p(r_c \mid \text{rain})\right)
    - \ln p(r_c \mid \text{chosen})$$

    It rains in a cycle with the probability `POORLY` p.

    Parameters
    ----------
    block : Block
        With the surge that is supposed while it is dry.
    residuals : (k,) array
    """
    dry, rain = _logs(block, residuals, 0.0) + np.log(1.0 - POORLY), _logs(block, residuals, RAIN) + np.log(POORLY)
    is_rainy = rain > dry
    unsure = np.logaddexp(dry, rain) - np.where(is_rainy, rain - np.log(POORLY), dry - np.log(1.0 - POORLY))
    return is_rainy[block.cycle], float(unsure.sum())


def _logs(block: Block, residuals: Floats, rain: float) -> Floats:
    """(cycles,) logarithms of the probability of the residuals of each, half of what surges do alike in its cells."""
    surging = 0.5 * (block.surge + rain) * block.variance
    weight = 1.0 / (expected_squares(block) + surging)
    shared = np.sqrt(surging)
    excess = 1.0 + block.cycle_sums(weight * shared**2)
    squares = block.cycle_sums(weight * residuals**2) - block.cycle_sums(weight * shared * residuals) ** 2 / excess
    return np.asarray(-0.5 * (squares + np.log(excess) - block.cycle_sums(np.log(weight))), dtype=np.float64)
