"""How an inflow that nobody measures moves, learnt from the level while no pump runs."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.jit import compiled
from wetwell.sim2real.replay.level_filter import BEGUN_ANEW, Uncertain, level_filter, step_of
from wetwell.simulator.parameters import SensorParameters
from wetwell.simulator.telemetry.damping import damped_by

DRIFT = 2.0 * 0.05**2 / 900.0
"""Growth of the variance of an inflow that changes by a twentieth of what a pump carries in a quarter of an hour.

Over the square of what a pump carries; from here the search begins. [1/s]
"""
WAVE = 0.03
"""Standard deviation of what comes in anew in each second, over what a pump carries; the search begins here. [1]"""
PRIOR_WIDTH = float(np.log(10.0))
"""Standard deviation of the logarithm of each before anything is seen: a factor of ten. Few rests say little."""
SOUGHT = ((1e-4, 1e4), (0.1, 100.0))
"""Of both, over where the search begins. [1]"""
LOG_SOUGHT = np.log(SOUGHT)
LAGS_S = (0.0, 5.0, 10.0, 20.0, 40.0)
"""Lags that the sensor may have: behind one, an inflow looks smoother than it is. [s]"""
ROUGHLY, CLOSELY = 0.2, 0.05
"""Shares of the spans by which the search first steps: under the first lag, and on from one lag to the next."""
CLOSE = 0.1
"""Logarithms within which the search ends."""
COST_ALIKE = 1.0
"""Twice the logarithm of the likelihood within which the search ends."""
LEAST_TOLD = 3.84
"""Twice the logarithm of the likelihood by which a lag must be the less likely one: 95 % of chi-squared."""
FORGOTTEN = 20.0
"""Times its lag after which a sensor shows all that was. [1]"""
MOST_S = 100_000
"""Seconds at rest from which an inflow is learnt: those of the first rests, where there are more."""
MOST_SQUARE = 9.0
"""Square of a standardised error beyond which it says no more about how an inflow moves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bends:
    """How the level of rows bends at rest: what of it the inflow does not make is noise of the sensor.

    Attributes
    ----------
    noise_m2 : float
        Variance of the noise that they show if the inflow makes nothing of them. [m²]
    every_s : int
        From row to row. [s]
    least_noise_m : float
        Standard deviation of the noise at the least. [m]
    """

    noise_m2: float
    every_s: int
    least_noise_m: float

    def under(self, moving: Uncertain, made: Floats) -> Uncertain:
        """A process of the inflow with the noise that it leaves of the bends; `made` as of `inflow_bends`."""
        noise_m2 = self.noise_m2 - float(made @ (moving.drift_m2_s3, moving.waves_m2_s))
        return replace(moving, noise_m2=max(noise_m2, self.least_noise_m**2))


@dataclass(frozen=True, slots=True, kw_only=True)
class InflowProcess:
    """How an inflow moves if the sensor of the level lags by so much.

    Attributes
    ----------
    lags_s : tuple of float
        Of the sensor, rising. [s]
    under : tuple of Uncertain
        One for each lag; they differ in the process.
    bends : Bends, optional
        From which the noise under a lag comes; none where it is known otherwise.
    """

    lags_s: tuple[float, ...]
    under: tuple[Uncertain, ...]
    bends: Bends | None = None

    def at(self, sensor: SensorParameters) -> Uncertain:
        """What is uncertain under a sensor; between two lags the logarithms of the process go straight."""
        if self.bends is None:
            return self.under[0]
        lag_s = step_of(sensor)[2]
        logs = np.log([[one.drift_m2_s3, one.waves_m2_s] for one in self.under])
        drift_m2_s3, waves_m2_s = np.exp([np.interp(lag_s, self.lags_s, each) for each in logs.T])
        moving = replace(self.under[0], drift_m2_s3=drift_m2_s3, waves_m2_s=waves_m2_s)
        return self.bends.under(moving, inflow_bends(sensor, self.bends.every_s))


def learnt_process(
    uncertain: Uncertain,
    level_m: Floats,
    is_idle: Flags,
    is_settled: Flags,
    sensor: SensorParameters,
    carried_m_s: float,
    rate_s: float,
    least_noise_m: float,
) -> InflowProcess:
    r"""Likeliest process of the inflow under each lag of the sensor, by the level's errors at rest.

    $$c_l = \min_{q, w} \sum_k \left[\min(e_k^2 / v_k, 9) + \ln v_k\right]
    + \left(\ln q / q_0\right)^2 / s^2 + \left(\ln w / w_0\right)^2 / 4 s^2$$

    with the errors $e_k$ of Kalman's filter under lag l, $v_k$ their variance, and a prior of width s that few rests
    do not overrule. Behind a lag, an inflow that is anew in each second looks like a smoother one without. Lags that
    rests make less likely have no process of their own. The noise of the sensor is what the bends of the level show,
    without what the inflow makes of them under that lag (`inflow_bends`).

    Parameters
    ----------
    uncertain : Uncertain
        Its process does not count; its noise is by the bends of the rows.
    level_m : (n,) array
        As measured. [m]
    is_idle, is_settled : (n,) arrays
        Seconds in which no pump runs, and those whose errors count.
    sensor : SensorParameters
        Of the level, as the station file has it.
    carried_m_s : float
        What a pump carries, over the area. [m/s]
    rate_s : float
        From row to row: a lag of less than half of that does not show. [s]
    least_noise_m : float
        That a sensor has, however little its bends show: values that are held have none. [m]

    References
    ----------
    Nelder, J. A., Mead, R.: A simplex method for function minimization. Computer Journal 7 (1965) 308-313.
    """
    idle = np.flatnonzero(is_idle)
    if not np.any(is_settled[idle] & uncertain.is_known[idle]):
        return InflowProcess(lags_s=(0.0,), under=(replace(uncertain, drift_m2_s3=DRIFT * carried_m_s**2),))
    bends = Bends(noise_m2=uncertain.noise_m2, every_s=round(rate_s), least_noise_m=least_noise_m)
    at_rest = _at_rest(uncertain, level_m, idle, is_settled, carried_m_s, bends)
    logs, found = np.zeros(2), []
    for lag_s in LAGS_S:
        if lag_s == 0.0 or lag_s >= 0.5 * rate_s:
            lagging = damped_by(sensor, lag_s, 0.0)
            made = inflow_bends(lagging, bends.every_s)
            logs, cost = at_rest.likeliest(lagging, made, logs, ROUGHLY if lag_s == 0.0 else CLOSELY)
            found.append((cost, step_of(lagging)[2], at_rest.moving(logs, made)))
    least, _, _ = min(found, key=lambda one: one[0])
    likely = [(lag_s, process) for cost, lag_s, process in found if cost <= least + LEAST_TOLD]
    return InflowProcess(
        lags_s=tuple(lag_s for lag_s, _ in likely),
        under=tuple(replace(uncertain, drift_m2_s3=one.drift_m2_s3, waves_m2_s=one.waves_m2_s) for _, one in likely),
        bends=bends,
    )


def inflow_bends(sensor: SensorParameters, every_s: int) -> Floats:
    r"""What an inflow makes of the variance that bends of the level show as noise.

    $$\tfrac16 \sum_j d_j^T \begin{pmatrix} w + q/3 & q/2 \\ q/2 & q \end{pmatrix} d_j, \qquad
    d_j = r_{j + n} - 2 r_j + r_{j - n}, \qquad r_j = h^T F^j G$$

    with what the sensor shows j seconds after the inflow moved, $r_j$, and n seconds from row to row; without a lag
    it is $w n / 3$ and a little of q. White noise has bends of six times its variance.

    Parameters
    ----------
    sensor : SensorParameters
        Of the level.
    every_s : int
        n. [s]

    Returns
    -------
    (2,) array
        Shares of q and w: the noise that they look like, over each. [s³, s]
    """
    step, of_level, lag_s = step_of(sensor)
    before = 2 * every_s
    shown = np.zeros((2, 2 * before + int(np.ceil(FORGOTTEN * lag_s))))
    moved = np.column_stack([of_level, [0.0, 1.0, 0.0, 0.0]])
    for j in range(before, shown.shape[1]):
        shown[:, j] = moved[3]
        moved = step @ moved
    bends = shown[:, before:] - 2.0 * shown[:, every_s:-every_s] + shown[:, :-before]
    (waves, both), (_, drift) = bends @ bends.T / 6.0
    return np.array([drift + both + waves / 3.0, waves])


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rest:
    """The level while no pump runs, one rest after the other; `rows` are the seconds that count."""

    uncertain: Uncertain
    level_m: Floats
    rows: Flags
    carried_m_s: float
    bends: Bends

    def moving(self, logs: Floats, made: Floats) -> Uncertain:
        """With a process of the inflow: logarithms of drift and waves, over where the search begins.

        What the process has `made` of the bends of the level (`inflow_bends`) is no noise of the sensor.
        """
        drift, wave = np.exp(logs)
        moving = replace(
            self.uncertain,
            drift_m2_s3=DRIFT * drift * self.carried_m_s**2,
            waves_m2_s=(WAVE * wave * self.carried_m_s) ** 2,
        )
        return self.bends.under(moving, made)

    def cost(self, logs: Floats, sensor: SensorParameters, made: Floats) -> float:
        """Twice what it takes from the logarithm of the posterior; no error counts for much."""
        gains, variance_m2 = level_filter(self.moving(logs, made), sensor)
        error_m = np.full(self.level_m.size, np.nan)
        step, _, lag_s = step_of(sensor)
        _follow(step, lag_s, gains, self.uncertain.is_known, self.level_m, np.zeros((2, 4)), error_m)
        rows = self.rows & np.isfinite(error_m)
        squares = np.minimum(error_m[rows] ** 2 / variance_m2[rows], MOST_SQUARE)
        return float(np.sum(squares + np.log(variance_m2[rows])) + np.sum((logs / PRIOR_WIDTH) ** 2))

    def likeliest(self, sensor: SensorParameters, made: Floats, first: Floats, step: float) -> tuple[Floats, float]:
        """Logarithms that cost least, reached from the first ones, and that cost."""
        steps = step * np.diff(LOG_SOUGHT)[:, 0]
        inwards = np.where(first > LOG_SOUGHT.mean(axis=1), -steps, steps)
        simplex = np.vstack([first, first + np.diag(inwards)])
        found = minimize(
            self.cost,
            first,
            args=(sensor, made),
            method="Nelder-Mead",
            bounds=LOG_SOUGHT.tolist(),
            options={"initial_simplex": simplex, "xatol": CLOSE, "fatol": COST_ALIKE},
        )
        return np.asarray(found.x, dtype=np.float64), float(found.fun)


def _at_rest(
    uncertain: Uncertain,
    level_m: Floats,
    idle: Integers,
    is_settled: Flags,
    carried_m_s: float,
    bends: Bends,
) -> _Rest:
    """Level of the idle seconds; before each rest there is a pause, after which all but the inflow begins anew."""
    rests = np.split(idle, np.flatnonzero(np.diff(idle) > 1) + 1)
    rests = rests[: int(np.searchsorted(np.cumsum([rest.size for rest in rests]), MOST_S)) + 1]
    begin = np.cumsum([rest.size for rest in rests])[:-1]
    place = np.insert(np.concatenate(rests), np.repeat(begin, int(uncertain.lost_s) + 1), -1)
    is_known = uncertain.is_known[place] & (place >= 0)
    open_m2 = np.where(place >= 0, uncertain.open_m2[place], 0.0)
    return _Rest(
        uncertain=replace(uncertain, is_known=is_known, open_m2=open_m2, keeps_inflow=True),
        level_m=level_m[place],
        rows=is_known & is_settled[place],
        carried_m_s=carried_m_s,
        bends=bends,
    )


@compiled
def _follow(
    step: Floats, lag_s: float, gains: Floats, is_known: Flags, level_m: Floats, room: Floats, error_m: Floats
) -> None:
    """Write the error before each value: where all begins anew, the sensor is at the value, and the level ahead."""
    now, after = room[0], room[1]
    for k in range(is_known.size):
        for i in range(4):
            after[i] = 0.0
            for j in range(4):
                after[i] += step[i, j] * now[j]
        for i in range(4):
            now[i] = after[i]
        if not is_known[k]:
            continue
        if gains[3, k] >= BEGUN_ANEW:
            now[2] = now[3] = level_m[k]
            now[0] = level_m[k] + lag_s * now[1]
            continue
        error_m[k] = level_m[k] - now[3]
        for i in range(4):
            now[i] += gains[i, k] * error_m[k]
