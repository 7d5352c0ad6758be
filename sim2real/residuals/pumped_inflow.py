"""An inflow without a meter that goes with the pumps: what all cycles have alike of its errors."""

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.recording.regimes import IDLE
from wetwell.sim2real.residuals.bins import Bins
from wetwell.sim2real.residuals.phases import PHASES_S, phase

FOLLOWED_S = 60
"""Time at rest after which the level shows nothing of the pumps: the observer has followed it. [s]"""


def alike_in_cycles(bins: Bins, errors: Floats) -> float:
    r"""Root mean square of what the errors of the level have alike in all cycles while nothing runs.

    $$\kappa^2 = \frac{\sum_s n_s \left(\bar z_s^2 - \operatorname{var}(z_s) / n_s\right)}{\sum_s n_s}$$

    over spans s of the time at rest, with $z_s$ the means of the $n_s$ cycles that have it. A rest ends as more comes
    in, and a run as less does. An inflow that jumps, as behind another station, therefore has errors of one sign in a
    regime. No pump can be wrong at rest: what is alike there is the inflow's.

    Parameters
    ----------
    bins : Bins
        Of the level.
    errors : (bins,) array
        Measured less predicted level, in units of its deviation.

    Returns
    -------
    float
        In units of the deviation; 0 where chance makes as much.

    Examples
    --------
    >>> from wetwell.sim2real.residuals.bins import NO_PUMP, Bins
    >>> cycle = np.repeat(np.arange(40), 3)
    >>> ones = np.ones(cycle.size)
    >>> at_rest = Bins(signal=0 * cycle, regime=0 * cycle + IDLE, cycle=cycle, pump=0 * cycle + NO_PUMP,
    ...                second=np.tile([0, 70, 100], 40) + 1000 * cycle, deviation=ones, floor=ones,
    ...                tolerance=ones, material=ones)
    >>> round(alike_in_cycles(at_rest, np.tile([9.0, 0.3, -0.4], 40)), 2)
    0.35
    """
    span = phase(bins)
    settled = (bins.regime == IDLE) & (span > np.searchsorted(PHASES_S, FOLLOWED_S))
    cycles = int(bins.cycle.max(initial=0)) + 1
    keys, of_bin = np.unique(span[settled] * cycles + bins.cycle[settled], return_inverse=True)
    means = np.bincount(of_bin, errors[settled]) / np.bincount(of_bin)
    spans, of_mean = np.unique(keys // cycles, return_inverse=True)
    count = np.bincount(of_mean, minlength=spans.size).astype(np.float64)
    mean = np.bincount(of_mean, means) / count
    scatter = np.bincount(of_mean, (means - mean[of_mean]) ** 2) / np.maximum(count - 1.0, 1.0)
    is_known = count > 1.0
    alike = np.where(is_known, count * mean**2 - scatter, 0.0)
    return float(np.sqrt(max(alike.sum() / max(count[is_known].sum(), 1.0), 0.0)))
