"""Noise of values that come in runs: some of it common to a run, some new in each value, now and then a wrong one."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats, Integers

DEGREES = 4.0
"""Degrees of freedom of Student's t, by which the weight of a value falls with its distance. [1]

After K. L. Lange, R. J. A. Little and J. M. G. Taylor (1989), Robust statistical modeling using the t distribution,
Journal of the American Statistical Association 84, who found 4 to serve data with a few per cent of outliers."""
SD_OF_MAD = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""
SMALLEST_SD = 1e-4
"""Standard deviation of a relative error at the least: what rounding leaves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunNoise:
    r"""Errors with one standard deviation, correlated within a run.

    Runs are the groups in which a pump rags, air gathers and meters drift: the values of a run say less than as many
    of different runs.

    Attributes
    ----------
    sd : float
        [1]
    correlation : float
        Between two values of a run, 0 to 1.
    weight : (n,) array
        What each value counts for: less far from the centre, and less beside others of its run.
    """

    sd: float
    correlation: float
    weight: Floats

    @classmethod
    def of_errors(cls, error: Floats, run: Integers, parameters: float = 0.0) -> "RunNoise":
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
        share = 1.0 / (1.0 + (count - 1.0) * correlation)
        told = float(np.sum(share * count))
        sd *= np.sqrt(told / max(told - parameters, 1.0))
        return cls(sd=float(sd), correlation=correlation, weight=student_weight(error / sd) * share[run])

    def whitened(self, values: Floats) -> Floats:
        """Values (n, ...) in units of their noise."""
        scale = np.sqrt(self.weight) / self.sd
        white: Floats = values * scale.reshape(-1, *[1] * (values.ndim - 1))
        return white


def student_weight(distance: Floats) -> Floats:
    r"""Weight of a value at a distance in standard deviations, $(\nu + 1) / (\nu + z^2)$, at most 1.

    Examples
    --------
    >>> student_weight(np.array([0.0, 1.0, 6.0]))
    array([1.   , 1.   , 0.125])
    """
    return np.asarray(np.minimum((DEGREES + 1.0) / (DEGREES + distance**2), 1.0))


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
