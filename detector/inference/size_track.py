"""The size of a fault carried from run to run: how large it is, and how fast it grows."""

import math
from dataclasses import dataclass, field

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.timestamps import NS_PER_DAY

SIZE, RATE, DISTURBANCE = range(3)
RATE_CHANGES = np.array([0.001, 0.003, 0.01, 0.03, 0.1, 1.0, 10.0])
"""How fast a rate of growth changes, as a bank of filters: standard deviation, in sizes of usual faults a day, after
a day. From wear over years to a blockage within hours."""
FIRST_RATE_DAYS = 10.0
"""The rate of what has just begun may be what this time makes of its changes. [d]"""
DISTURBANCE_DAYS = 0.25
"""Time after which what disturbs runs is forgotten: that of a daily wave, a quarter of its period. [d]"""
WEIGHT_DAYS = 4.0
"""Time after which what the filters of the bank have been worth is forgotten. [d]"""
JUMP_SCALES = (1.0, 0.02)
"""Variances of faults that appear at once, as shares of that of the usual size: large, and just begun."""
_GROWTH_DIVISORS = np.array([[3.0, 2.0], [2.0, 1.0]])
"""Of the powers of time in the covariance of size and rate that white noise of the growth makes."""


@dataclass(slots=True)
class SizeTrack:
    r"""Belief over the size of one fault: it grows, stays, or is cleared.

    $$\dot s = v, \qquad \dot v = q\,w, \qquad y_i = s(t_i) + b(t_i) + e_i$$

    with b, what disturbs all runs of some hours alike, an Ornstein-Uhlenbeck process: without it the error of a
    trend would be that of independent runs, which is far too small. q is not known: a Kalman filter runs for each of
    `RATE_CHANGES`, weighed by how well it foretold the runs of the last days. A run that no filter explains, and a
    fault that has gone or has jumped does, begins the belief anew: at once if what is told of it says so, else if the
    next run is strange as well.

    Attributes
    ----------
    time_ns : int or None
        Of the last run; None before the first.
    mean : (m, 3) array
        Size, rate a day and disturbance, of each filter. [unit of the size]
    covariance : (m, 3, 3) array
    log_weight : (m,) array
    is_strange : bool
        Whether the last run was one that was left out.

    References
    ----------
    .. [1] Y. Bar-Shalom, X. R. Li, T. Kirubarajan, Estimation with Applications to Tracking and Navigation: the
       multiple-model estimator, white-noise acceleration.
    """

    time_ns: int | None = None
    mean: Floats = field(default_factory=lambda: np.zeros((len(RATE_CHANGES), 3)))
    covariance: Floats = field(default_factory=lambda: np.zeros((len(RATE_CHANGES), 3, 3)))
    log_weight: Floats = field(default_factory=lambda: np.full(len(RATE_CHANGES), -math.log(len(RATE_CHANGES))))
    is_strange: bool = False

    def foretold(self, time_ns: int, scale: float, disturbance: float) -> tuple[float, float]:
        """Size that a run is expected to show, and the variance of that.

        Parameters
        ----------
        time_ns : int
        scale : float
            Size of usual faults. [unit of the size]
        disturbance : float
            Variance of what disturbs all runs of some hours alike. [unit², as all variances]
        """
        if self.time_ns is None:
            return 0.0, disturbance
        days = max(time_ns - self.time_ns, 0) / NS_PER_DAY
        kept = math.exp(-days / DISTURBANCE_DAYS)
        mean = self.mean[:, SIZE] + days * self.mean[:, RATE] + kept * self.mean[:, DISTURBANCE]
        way = np.array([1.0, days, kept])
        variance = self.covariance @ way @ way
        variance += (RATE_CHANGES * scale) ** 2 * days**3 / 3.0 + (1.0 - kept**2) * disturbance
        return _mixed(mean, variance, _normalised(math.exp(-days / WEIGHT_DAYS) * self.log_weight))

    def update(
        self,
        time_ns: int,
        value: float,
        variance: float,
        scale: float,
        disturbance: float,
        change_share: float,
        *,
        is_sure: bool,
    ) -> bool:
        """Take a run into account; whether the belief began anew.

        Parameters
        ----------
        time_ns, scale, disturbance
            As of `foretold`.
        value, variance : float
            What the run shows, and the variance of that by its own.
        change_share : float
            Of runs before which a fault has come or gone.
        is_sure : bool
            Whether this run says that a fault has come or gone.
        """
        mean, covariance, log_weight = self._ahead(time_ns, scale, disturbance)
        self.time_ns = time_ns
        gain = covariance[:, :, SIZE] + covariance[:, :, DISTURBANCE]
        total = gain[:, SIZE] + gain[:, DISTURBANCE] + variance
        error = value - mean[:, SIZE] - mean[:, DISTURBANCE]
        log_each = log_weight - 0.5 * (np.log(total) + error**2 / total)
        log_carried = _log_sum(log_each)
        own = variance + disturbance
        log_gone = math.log(change_share) - 0.5 * (math.log(own) + value**2 / own)
        jumps = [own + share * scale**2 for share in JUMP_SCALES]
        log_each_jump = [-0.5 * (math.log(jump) + value**2 / jump) for jump in jumps]
        log_jump = math.log(change_share**2 / len(jumps)) + float(np.logaddexp.reduce(log_each_jump))
        was_strange, self.is_strange = self.is_strange, max(log_gone, log_jump) > log_carried
        is_anew = self.is_strange and (is_sure or was_strange)
        if is_anew:
            mean, covariance = _anew(0.0 if log_gone > log_jump else value, own, scale, disturbance)
            log_weight = np.full(len(RATE_CHANGES), -math.log(len(RATE_CHANGES)))
            self.is_strange = False
        elif not self.is_strange:
            share = gain / total[:, np.newaxis]
            mean = mean + share * error[:, np.newaxis]
            covariance = covariance - share[:, :, np.newaxis] * gain[:, np.newaxis, :]
            log_weight = log_each - log_carried
        self.mean, self.covariance, self.log_weight = mean, covariance, log_weight
        return is_anew

    @property
    def size(self) -> tuple[float, float]:
        """Size at the last run, and its variance."""
        return _mixed(self.mean[:, SIZE], self.covariance[:, SIZE, SIZE], self.log_weight)

    @property
    def rate(self) -> tuple[float, float]:
        """Growth a day, and its variance."""
        return _mixed(self.mean[:, RATE], self.covariance[:, RATE, RATE], self.log_weight)

    def ahead(self, days: Floats, scale: float) -> tuple[Floats, Floats]:
        """Size after (n,) days from the last run on, and its variances."""
        size, rate = self.mean[:, SIZE, np.newaxis], self.mean[:, RATE, np.newaxis]
        covariance = self.covariance[..., np.newaxis]
        change = (RATE_CHANGES[:, np.newaxis] * scale) ** 2
        means = size + rate * days
        variances = covariance[:, SIZE, SIZE] + 2.0 * days * covariance[:, SIZE, RATE]
        variances = variances + days**2 * covariance[:, RATE, RATE] + change * days**3 / 3.0
        weight = np.exp(self.log_weight)
        middle = weight @ means
        return middle, weight @ (variances + (means - middle) ** 2)

    def _ahead(self, time_ns: int, scale: float, disturbance: float) -> tuple[Floats, Floats, Floats]:
        if self.time_ns is None:
            mean, covariance = _anew(0.0, 0.0, scale, disturbance)
            return mean, covariance, self.log_weight
        days = max(time_ns - self.time_ns, 0) / NS_PER_DAY
        kept = math.exp(-days / DISTURBANCE_DAYS)
        step = np.array([[1.0, days, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, kept]])
        covariance = step @ self.covariance @ step.T
        change = (RATE_CHANGES * scale) ** 2
        powers = np.array([[days**3, days**2], [days**2, days]])
        covariance[:, : RATE + 1, : RATE + 1] += change[:, np.newaxis, np.newaxis] * powers / _GROWTH_DIVISORS
        covariance[:, DISTURBANCE, DISTURBANCE] += (1.0 - kept**2) * disturbance
        log_weight = math.exp(-days / WEIGHT_DAYS) * self.log_weight
        return self.mean @ step.T, covariance, _normalised(log_weight)


def _anew(value: float, variance: float, scale: float, disturbance: float) -> tuple[Floats, Floats]:
    """Mean and covariance of all filters of a belief that begins with this size."""
    mean = np.zeros((len(RATE_CHANGES), 3))
    mean[:, SIZE] = value
    covariance = np.zeros((len(RATE_CHANGES), 3, 3))
    covariance[:, SIZE, SIZE] = variance
    covariance[:, RATE, RATE] = FIRST_RATE_DAYS * (RATE_CHANGES * scale) ** 2
    covariance[:, DISTURBANCE, DISTURBANCE] = disturbance
    return mean, covariance


def _log_sum(log_values: Floats) -> float:
    """Logarithm of the sum of a few logarithms; SciPy's takes ten times as long on five."""
    top = max(log_values.tolist())
    return float(top + math.log(sum(np.exp(log_values - top).tolist())))


def _normalised(log_weight: Floats) -> Floats:
    return log_weight - _log_sum(log_weight)


def _mixed(means: Floats, variances: Floats, log_weight: Floats) -> tuple[float, float]:
    """Mean and variance of what the filters say together."""
    weight = np.exp(log_weight)
    middle = float(weight @ means)
    return middle, float(weight @ (variances + (means - middle) ** 2))
