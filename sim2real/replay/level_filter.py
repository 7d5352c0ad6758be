"""Kalman's filter of a level, of an inflow that nobody measures, and of a sensor that lags."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.protocols.jit import compiled
from wetwell.simulator.parameters import SensorParameters

MOST_FOLLOWED = 0.5
"""Share of an error that one value may take away by the least gain, however long there was none."""
BEGUN_ANEW = 1.0
"""Share of an error that is taken away by beginning anew, which is all of it."""
UNKNOWN = 1e6
"""Variance of a level of which nothing is known, over that of its sensor."""
STEADY_GAIN = 1e-12
"""Change of a gain in a second, and of a variance as a share of it, under which they stay what they are."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Uncertain:
    """What the filter takes to be uncertain.

    Attributes
    ----------
    is_known : (n,) array
        Seconds with a value of the level.
    open_m2 : (n,) array
        Variance that a switch at a moment that nobody knows adds to the level in each second. [m²]
    noise_m2 : float
        Variance of the sensor's noise. [m²]
    drift_m2_s3 : float
        q, by which the variance of an unknown inflow over the area grows; of the error of a meter, by which it is
        renewed as it goes over. [m²/s³]
    waves_m2_s : float
        w, by which the variance of the level grows, of what comes in anew in each second. [m²/s]
    first_m2_s2 : float
        Variance of that inflow before anything is known of it. [m²/s²]
    metered_m2_s2 : float
        Variance of the mean of a measured inflow over the area between two rows, each by itself. [m²/s²]
    lost_s : float
        After that long without a value the filter begins anew. [s]
    inflow_kept : float
        Share of the inflow that is not known that is left after a second: all of one without a meter. [1]
    least_gain : float
        Share of an error that is taken away in a second at the least. [1/s]
    keeps_inflow : bool
        Whether the inflow is known after such a time but for its drift.
    """

    is_known: Flags
    open_m2: Floats
    noise_m2: float
    drift_m2_s3: float
    waves_m2_s: float
    first_m2_s2: float
    metered_m2_s2: float
    lost_s: float
    least_gain: float
    inflow_kept: float = 1.0
    keeps_inflow: bool = False


def level_filter(uncertain: Uncertain, sensor: SensorParameters) -> tuple[Floats, Floats]:
    r"""Gains of the filter, and the variances of its errors.

    $$x = (L, b, s_1, s_2)^T, \qquad L' = L + b, \qquad b' = \kappa b, \qquad s_1' = (f - l) L' + l L + (1 - f)\, s_1,
    \qquad y = s_2 + v$$

    with L the level, b the inflow that is not known over the area, of which κ is left after a second, and $s_1$,
    $s_2$ what the filters of the sensor hold after a second; $s_2 = s_1$ where it has one, and L where it has none.
    The inflow wanders with q, and w of it is of a second only:

    $$P \leftarrow F P F^T + G \begin{pmatrix} w + q/3 & q/2 \\ q/2 & q \end{pmatrix} G^T, \qquad
    K = \frac{P h}{h^T P h + \sigma^2}, \qquad P \leftarrow (I - K h^T) P (I - K h^T)^T + \sigma^2 K K^T$$

    Parameters
    ----------
    uncertain : Uncertain
    sensor : SensorParameters
        Lag of the level sensor.

    Returns
    -------
    gains : (4, n) array
        K of L, b, s₁ and s₂; of s₂ `BEGUN_ANEW` where the filter begins anew, else less. [1, 1/s, 1, 1]
    variance_m2 : (n,) array
        Variance of the error before each value, the sensor's noise included; NaN where there is no value. [m²]

    References
    ----------
    Kalman, R. E.: A new approach to linear filtering and prediction problems. J. Basic Eng. 82 (1960) 35-45.
    """
    step, of_level, lag_s = step_of(sensor)
    step[1, 1] = uncertain.inflow_kept
    seconds = uncertain.is_known.size
    gains, variance_m2 = np.zeros((4, seconds)), np.full(seconds, np.nan)
    _filter(
        step,
        of_level,
        lag_s,
        uncertain.is_known,
        uncertain.open_m2,
        uncertain.noise_m2,
        uncertain.drift_m2_s3,
        uncertain.waves_m2_s,
        uncertain.first_m2_s2,
        uncertain.metered_m2_s2,
        uncertain.lost_s,
        uncertain.least_gain,
        uncertain.keeps_inflow,
        np.zeros((3, 4, 4)),
        np.zeros(4),
        gains,
        variance_m2,
    )
    return gains, variance_m2


def step_of(sensor: SensorParameters) -> tuple[Floats, Floats, float]:
    """(4, 4) F of a second, (4,) shares of the new level that each state takes, and the whole lag. [1, 1, s]."""
    first, again = sensor.followed, sensor.followed_again
    whole_s = (1.0 - first + sensor.late) / first
    row, late = [first, 1.0 - first, 0.0], sensor.late
    if sensor.carried > 0.0:
        row, late = [again - sensor.carried, sensor.carried, 1.0 - again], sensor.late_again
        whole_s = (1.0 - again + sensor.carried * (1.0 + whole_s) + late) / again
    of_level = np.array([1.0, 0.0, first - sensor.late, row[0] - late])
    step = np.zeros((4, 4))
    step[0, 0] = step[1, 1] = 1.0
    step[:, 1] += of_level
    step[2, [0, 2]] = first, 1.0 - first
    step[3, [0, 2, 3]] = row
    return step, of_level, whole_s


@compiled
def _filter(
    step: Floats,
    of_level: Floats,
    lag_s: float,
    is_known: Flags,
    open_m2: Floats,
    noise_m2: float,
    drift: float,
    waves: float,
    first: float,
    metered: float,
    lost_s: float,
    least_gain: float,
    keeps_inflow: bool,
    room: Floats,
    gain: Floats,
    gains: Floats,
    variance_m2: Floats,
) -> None:
    """Write gains, and variances of the error before each value.

    Where each second has a value and nothing is open, they soon stay what they are.
    """
    spread, before, wandering = room[0], room[1], room[2]
    _wander(drift, waves, of_level, wandering)
    last, is_settled = -1, False
    for k in range(is_known.size):
        since = k - last
        if is_settled and is_known[k] and open_m2[k] == 0.0:
            _copy(gain, gains, k)
            variance_m2[k] = variance_m2[k - 1]
            last = k
            continue
        is_settled = False
        _carry(step, spread, before)
        _add(open_m2[k] + metered * (2.0 * since - 1.0), of_level, wandering, spread)
        if not is_known[k]:
            continue
        is_anew = last < 0 or since > lost_s
        if is_anew:
            unknown_m2_s2 = min(spread[1, 1], first) if keeps_inflow and last >= 0 else first
            _begin(UNKNOWN * noise_m2, unknown_m2_s2, lag_s, spread)
        seen = variance_m2[k] = spread[3, 3] + noise_m2
        moved = _weigh(spread, seen, min(least_gain * since, MOST_FOLLOWED), gain)
        _copy(gain, gains, k)
        _correct(gain, noise_m2, spread, before)
        if is_anew:
            gains[0, k] = gains[2, k] = gains[3, k] = BEGUN_ANEW
            gains[1, k] = 0.0
        is_settled = since == 1 and moved < STEADY_GAIN and abs(seen - variance_m2[k - 1]) < STEADY_GAIN * seen
        last = k


@compiled
def _wander(drift: float, waves: float, of_level: Floats, wandering: Floats) -> None:
    """Write G (w + q/3, q/2; q/2, q) G^T."""
    for i in range(4):
        for j in range(4):
            wandering[i, j] = (waves + drift / 3.0) * of_level[i] * of_level[j]
    for i in range(4):
        wandering[i, 1] = wandering[1, i] = 0.5 * drift * of_level[i]
    wandering[1, 1] = drift


@compiled
def _begin(unknown_m2: float, first: float, lag_s: float, spread: Floats) -> None:
    """Know nothing but that the level is ahead of its sensor by what comes in within the time of the lag."""
    for i in range(4):
        for j in range(4):
            spread[i, j] = 0.0 if i == 1 or j == 1 else unknown_m2
    spread[0, 0] += lag_s**2 * first
    spread[0, 1] = spread[1, 0] = lag_s * first
    spread[1, 1] = first


@compiled
def _add(added_m2: float, of_level: Floats, wandering: Floats, spread: Floats) -> None:
    """Add what a second makes uncertain: the inflow wanders, and the level by what is added."""
    for i in range(4):
        for j in range(4):
            spread[i, j] += wandering[i, j] + added_m2 * of_level[i] * of_level[j]


@compiled
def _weigh(spread: Floats, seen: float, least: float, gain: Floats) -> float:
    """Write the gain, but for that of the inflow no less than the least; return by how much it has changed."""
    moved = 0.0
    for i in range(4):
        now = spread[i, 3] / seen
        if i != 1:
            now = max(now, least)
        moved = max(moved, abs(now - gain[i]))
        gain[i] = now
    return moved


@compiled
def _copy(gain: Floats, gains: Floats, k: int) -> None:
    for i in range(4):
        gains[i, k] = gain[i]


@compiled
def _carry(step: Floats, spread: Floats, room: Floats) -> None:
    """P <- F P F^T."""
    for i in range(4):
        for j in range(4):
            room[i, j] = 0.0
            for m in range(4):
                room[i, j] += step[i, m] * spread[m, j]
    for i in range(4):
        for j in range(4):
            spread[i, j] = 0.0
            for m in range(4):
                spread[i, j] += room[i, m] * step[j, m]


@compiled
def _correct(gain: Floats, noise_m2: float, spread: Floats, room: Floats) -> None:
    """P <- (I - K h^T) P (I - K h^T)^T + r K K^T, which is right for any gain: Joseph's form."""
    for i in range(4):
        for j in range(4):
            room[i, j] = spread[i, j] - gain[i] * spread[3, j]
    for i in range(4):
        for j in range(4):
            spread[i, j] = room[i, j] - room[i, 3] * gain[j] + noise_m2 * gain[i] * gain[j]
