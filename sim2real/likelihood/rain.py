"""Rain: cycles in which an inflow without a meter moves much faster than while it is dry."""

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.likelihood.cells import POORLY, RAIN, Block
from wetwell.sim2real.likelihood.covariance import expected_squares


def rainy_cells(block: Block, residuals: Floats) -> tuple[Flags, float]:
    r"""Where it rains, most probably, and what not knowing it adds to the logarithm of the probability.

    $$\sum_c \ln\left((1 - p)\,p(r_c \mid \text{dry}) + p\,p(r_c \mid \text{rain})\right)
    - \ln p(r_c \mid \text{chosen})$$

    It rains in a cycle with the probability p: `POORLY`, but where several pumps run it is dry with that one.

    Parameters
    ----------
    block : Block
        With the surge that is supposed while it is dry.
    residuals : (k,) array
    """
    log_dry, log_rain = log_priors(block)
    dry, rain = _logs(block, residuals, 0.0), _logs(block, residuals, RAIN)
    is_rainy = rain + log_rain > dry + log_dry
    unsure = np.logaddexp(dry + log_dry, rain + log_rain) - np.where(is_rainy, rain, dry)
    return is_rainy[block.cycle], float(unsure.sum())


def log_priors(block: Block) -> tuple[Floats, Floats]:
    """(cycles,) logarithms of the probabilities that it is dry, and that it rains."""
    rain = np.where(block.in_storm, 1.0 - POORLY, POORLY)
    return np.log1p(-rain), np.log(rain)


def _logs(block: Block, residuals: Floats, rain: float) -> Floats:
    """(cycles,) logarithms of the probability of the residuals of each, half of what surges do alike in its cells."""
    surging = 0.5 * (block.surge + rain) * block.of_inflow
    weight = 1.0 / (expected_squares(block) + surging)
    shared = np.sqrt(surging)
    excess = 1.0 + block.cycle_sums(weight * shared**2)
    squares = block.cycle_sums(weight * residuals**2) - block.cycle_sums(weight * shared * residuals) ** 2 / excess
    return np.asarray(-0.5 * (squares + np.log(excess) - block.cycle_sums(np.log(weight))), dtype=np.float64)
