"""Noise of values that come in runs: some of it common to a run, some new in each value, now and then a wrong one."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.sim2real.calibration.fit.student_t import split_sd, student_weight

SD_OF_MAD = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""
SMALLEST_SD = 1e-4
"""Standard deviation of a relative error at the least: what rounding leaves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunNoise:
    r"""Errors with a standard deviation, correlated within a run.

    Runs are the groups in which a pump rags, air gathers and meters drift: the values of a run say less than as many
    of different runs.

    Attributes
    ----------
    sd : float
        Of what was told too low, or of all. [1]
    correlation : float
        Between two values of a run, 0 to 1.
    weight : (n,) array
        What each value counts for: less far from the centre, and less beside others of its run.
    """

    sd: float
    correlation: float
    weight: Floats

    @classmethod
    def of_errors(
        cls, error: Floats, run: Integers, parameters: float = 0.0, *, is_lossy: bool = False
    ) -> "RunNoise":
        r"""Noise of errors, by medians.

        A value in a run of n counts for $1 / (1 + (n - 1) \rho)$ of one that is alone, the design effect of samples
        in clusters [1]_.

        Parameters
        ----------
        error : (n,) array
            [1]
        run : (n,) int array
            From 0, without a gap.
        parameters : float
            Number of parameters that were fitted to the errors; each takes freedom away.
        is_lossy : bool
            Whether what is measured can be lost but not gained, as flow to rags: values that were told too high may
            then scatter more than others, see `split_sd`.

        References
        ----------
        .. [1] L. Kish (1965), Survey Sampling, section 5.4.
        """
        count = np.bincount(run)
        sd = max(SD_OF_MAD * float(np.median(np.abs(error))), SMALLEST_SD)
        several = count[run] > 1
        correlation = 0.0
        if several.any():
            rest = np.abs(error - medians(error, run)[run])[several]
            lost = several.sum() / max(several.sum() - np.sum(count > 1), 1)
            correlation = 1.0 - lost * min(SD_OF_MAD * float(np.median(rest)) / sd, 1.0) ** 2
        correlation = max(correlation, 0.0)
        share: Floats = np.asarray(1.0 / (1.0 + (count - 1.0) * correlation), dtype=np.float64)
        told = float(np.sum(share * count))
        below, above = split_sd(error, share[run], sd) if is_lossy else (sd, sd)
        freedom = np.sqrt(told / max(told - parameters, 1.0))
        sd = max(below, SMALLEST_SD) * float(freedom)
        wider = np.where(error > 0.0, max(above / below, 1.0), 1.0)
        weight: Floats = student_weight(error / (sd * wider)) * share[run] / wider**2
        return cls(sd=sd, correlation=correlation, weight=weight)

    def whitened(self, values: Floats) -> Floats:
        """Values (n, ...) in units of their noise."""
        scale = np.sqrt(self.weight) / self.sd
        white: Floats = values * scale.reshape(-1, *[1] * (values.ndim - 1))
        return white


def medians(values: Floats, group: Integers) -> Floats:
    """(groups,) median of the values of each group; groups count from 0 without a gap.

    Examples
    --------
    >>> medians(np.array([3.0, 1.0, 2.0, 7.0]), np.array([0, 0, 0, 1]))
    array([2., 7.])
    """
    order = np.lexsort((values, group))
    count = np.bincount(group)
    first = np.cumsum(count) - count
    ranked = values[order]
    middle: Floats = 0.5 * (ranked[first + (count - 1) // 2] + ranked[first + count // 2])
    return middle
