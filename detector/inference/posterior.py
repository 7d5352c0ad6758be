"""Which state explains a run: normal, pump, system, both, or a meter that is wrong."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from wetwell.detector.baseline.model import Baseline
from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.inference.observation import DRAWDOWN, POWER, PUMP, SYSTEM, Observation
from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.messages.verdict import State

STATES: tuple[State, ...] = ("normal", "pump_fault", "system_fault", "pump_and_system_fault")
FAULT_STATES = STATES[1:]

NORMAL, PUMP_FAULT, SYSTEM_FAULT, BOTH, FLOW_METER, HEAD_SENSOR = range(6)
"""Hypotheses."""

SCALES = (1.0, 10.0, 0.02)
"""Faults of the usual size, broken machines, and faults that have just begun, as factors of the variances."""
PUMP_SHIFT_SHARE = 0.15
SYSTEM_SHIFT_SHARE = 0.3
SYSTEM_SHIFT_M = 1.0
FLOW_METER_ERROR = 0.1
HEAD_SENSOR_SHARE = 0.1
POWER_SHIFT = 0.15
LOAD_SHARE = 0.5
"""Of pumps whose power follows the load, so that a fault shifts it, or whose power meter drifts in health."""
DISTURBED_DRAWDOWN = 0.5
DISTURBED_SHARE = 0.05
"""Of runs in which inflow or supply disturb drawdown or power, so that they say nothing."""
FLOW_TRUST = 0.01
"""A flow meter is believed to this share where no drawdown that is as exact watches it."""
LOSING_SHARE = 0.95
"""Of pump faults: the curve falls. A pump that gets better has been cleaned, or was not healthy when learnt."""
RISING_SHARE = 0.9
"""Of system faults: the main takes more head. One that takes less may have burst."""


_FAULTS = [PUMP_FAULT, SYSTEM_FAULT, BOTH]


class _Table(NamedTuple):
    """Ways to shift: of each its hypothesis, the scales of new faults, the curves that one that is carried moves."""

    hypotheses: Integers
    new: Floats
    moves: Flags
    is_old: Flags
    flow: Integers
    head: Integers
    log_share: Floats
    is_of: Flags


def _table(*, carried: bool) -> _Table:
    """Ways of new faults, of each hypothesis the one at full scale before the others, then those that are carried."""
    rows: list[tuple[int, float, float, bool, bool]] = [(NORMAL, 0.0, 0.0, False, False)]
    for scale in SCALES:
        rows += [(PUMP_FAULT, scale, 0.0, False, False), (SYSTEM_FAULT, 0.0, scale, False, False)]
        rows += [(cause, scale, scale, False, False) for cause in (BOTH, FLOW_METER, HEAD_SENSOR)]
    if carried:
        rows += [(PUMP_FAULT, 0.0, 0.0, True, False), (SYSTEM_FAULT, 0.0, 0.0, False, True)]
        for scale in SCALES:
            rows += [(BOTH, 0.0, scale, True, False), (BOTH, scale, 0.0, False, True)]
        rows.append((BOTH, 0.0, 0.0, True, True))
    hypotheses = np.array([row[0] for row in rows])
    new = np.array([row[1:3] for row in rows])
    return _Table(
        hypotheses=hypotheses,
        new=new,
        moves=np.column_stack([np.isin(hypotheses, (PUMP_FAULT, BOTH)), np.isin(hypotheses, (SYSTEM_FAULT, BOTH))]),
        is_old=np.array([row[3:] for row in rows]),
        flow=np.flatnonzero(hypotheses == FLOW_METER),
        head=np.flatnonzero(hypotheses == HEAD_SENSOR),
        log_share=np.where(new.any(axis=1), -np.log(len(SCALES)), 0.0),
        is_of=hypotheses == np.arange(HEAD_SENSOR + 1)[:, np.newaxis],
    )


_NEW, _CARRIED = _table(carried=False), _table(carried=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scales:
    """Standard deviations of what faults bring: shifts of both curves, and of the measured head. [m]."""

    pump_m: float
    system_m: float
    head_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Posterior:
    """What a run says.

    Attributes
    ----------
    probability : (6,) array
        Of the hypotheses; sums to one.
    shift_m, deviation_m : (2,) arrays
        Estimates of the shifts of (r_p, r_s) if both may have moved, and their standard deviations. [m]
    tolerance_m : (2,) array
        What a flow meter that is wrong by `FLOW_TRUST` makes of them; 0 where the drawdown watches it. [m]
    flow_error, head_error_m : float
        Estimates under the hypothesis that this meter is wrong. [1, m]
    flow_deviation, head_deviation_m : float
        Their standard deviations. [1, m]
    """

    probability: Floats
    shift_m: Floats
    deviation_m: Floats
    tolerance_m: Floats
    flow_error: float
    head_error_m: float
    flow_deviation: float
    head_deviation_m: float

    def by_state(self) -> dict[State, float]:
        """Probability of each state, both meters together, as a message carries it."""
        p = self.probability
        named = {state: float(p[NORMAL + place]) for place, state in enumerate(STATES)}
        return named | {"sensor_fault": float(p[FLOW_METER] + p[HEAD_SENSOR])}


@dataclass(frozen=True, slots=True, kw_only=True)
class Carried:
    """Faults as they were before a run, if they are still there: of the pump and of the main.

    Attributes
    ----------
    mean_m, variance_m2 : (2,) arrays
        Shifts of (r_p, r_s) that they are expected to show. [m, m²]
    share : (2,) array
        Of the prior probability of a fault: that it is the one that was there before.
    """

    mean_m: Floats
    variance_m2: Floats
    share: Floats


def _ways(
    observation: Observation, scales: Scales, known: Flags, carried: Carried | None
) -> tuple[Flags, Floats, Floats, Floats]:
    """Each way to shift: (6, w) of which hypothesis, (w,) log of its share in that, (w, 4) mean, (w, 4, 4) spread.

    The first way of each hypothesis is the one at full scale.
    """
    table = _NEW if carried is None else _CARRIED
    new, moves = table.new, table.moves
    v_p, v_s = observation.slope_variance
    log_share = table.log_share
    offset, spread = np.zeros((len(new), 4)), np.zeros((len(new), 4, 4))
    tau_p, tau_s = scales.pump_m**2, scales.system_m**2
    slopes = moves[:, ::-1] | table.is_old  # what is carried was seen at another flow
    spread[:, PUMP, PUMP] = (
        moves[:, 0] * new[:, 0] * tau_p
        + moves[:, 1] * new[:, 1] * tau_s * observation.system_in_pump**2
        + slopes[:, 0] * v_p
    )
    spread[:, SYSTEM, SYSTEM] = moves[:, 1] * new[:, 1] * tau_s + slopes[:, 1] * v_s
    for meter, variance, way in (
        (table.flow, FLOW_METER_ERROR**2, observation.flow_meter),
        (table.head, scales.head_m**2, observation.head_sensor),
    ):
        spread[meter] = new[meter, :1, np.newaxis] * variance * (way[:, np.newaxis] * way)
    if carried is not None:
        offset[:, : SYSTEM + 1] = table.is_old * carried.mean_m
        spread[:, PUMP, PUMP] += table.is_old[:, 0] * carried.variance_m2[0]
        spread[:, SYSTEM, SYSTEM] += table.is_old[:, 1] * carried.variance_m2[1]
        log_old, log_new = np.log(np.maximum([carried.share, 1.0 - carried.share], 1e-300))
        log_share = log_share + (np.where(table.is_old, log_old, log_new) * moves).sum(axis=1)
    disturbed = (1.0 - DISTURBED_SHARE, DISTURBED_SHARE) if known[DRAWDOWN] else (1.0,)
    witnesses = 2 * len(disturbed) if known[POWER] else len(disturbed)
    ways = np.repeat(spread, witnesses, axis=0).reshape(len(new), len(disturbed), -1, 4, 4)
    ways[:, 1:, :, DRAWDOWN, DRAWDOWN] += DISTURBED_DRAWDOWN**2
    ways[:, :, 1:, POWER, POWER] += POWER_SHIFT**2
    share = np.array(disturbed)[:, np.newaxis]
    if known[POWER]:
        moving = np.where(table.hypotheses < FLOW_METER, LOAD_SHARE, DISTURBED_SHARE)
        share = share * np.column_stack([1.0 - moving, moving])[:, np.newaxis]
    log_each = np.broadcast_to(log_share[:, np.newaxis, np.newaxis] + np.log(share), ways.shape[:3]).ravel()
    is_of = np.repeat(table.is_of, witnesses, axis=1)
    return is_of, log_each, np.repeat(offset, witnesses, axis=0), ways.reshape(-1, 4, 4)


def _log_sums(log_values: Floats) -> Floats:
    """Logarithm of the sum of each row of logarithms."""
    top = log_values.max(axis=1)
    log_sums: Floats = top + np.log(np.exp(log_values - top[:, np.newaxis]).sum(axis=1))
    return log_sums


def fault_scales(datasheet: Datasheet, pump: int, baseline: Baseline) -> Scales:
    """Scales for a pump (from 0)."""
    shutoff_m = datasheet.curves[pump][0]
    return Scales(
        pump_m=PUMP_SHIFT_SHARE * shutoff_m,
        system_m=SYSTEM_SHIFT_SHARE * datasheet.main_of(pump).friction_h2_m5 * baseline.total_m3h**2 + SYSTEM_SHIFT_M,
        head_m=HEAD_SENSOR_SHARE * shutoff_m,
    )


def posterior_of(
    observation: Observation, scales: Scales, prior: Floats, carried: Carried | None = None
) -> Posterior:
    r"""Probability of each hypothesis after a run.

    $$P(h \mid y) \propto P(h)\; N(y;\ 0,\ C + D_h)\; S_h, \qquad
    D_{fault} = \mathrm{diag}(a_p \tau_p^2 + a_s v_p,\ a_s \tau_s^2 + a_p v_s,\ 0,\ \tau_P^2 \text{ or } 0),
    \qquad D_{meter} = \tau_m^2\, d\, d^T$$

    where a says which of the two curves a fault moves, τ how far, v what the slope of each curve may be wrong by (a
    pump fault moves the flow along the system curve, a system fault along the pump curve), d how a wrong meter moves
    all components, and S how usual the sign of the shift is. Each τ stands for large and for small shifts,
    weighed alike. A fault that was there before has grown or stayed, $N(y;\ \hat s, C + D)$ with the size that is
    carried along, or is another one now: so one that is gone is told at once. The power may follow the load or not,
    or drift: it tells a wrong meter from a fault, but no fault
    from health. In a few runs the drawdown is disturbed by something else and says nothing. Components that are not
    known are left out. Without a head sensor a run says that pump or main has moved, and not which: all faults are as
    likely as that of the pump, and the prior, with what the other pumps of the main have met, tells them apart; only
    the drawdown speaks of the flow meter then.

    Parameters
    ----------
    observation : Observation
        y, C, v and d.
    scales : Scales
        τ.
    prior : (6,) array
        P(h).
    carried : Carried, optional
        Faults of which the size is known; without it every fault is a new one.
    """
    known = np.isfinite(observation.mean) & np.isfinite(np.diag(observation.covariance))
    mean = observation.mean[known]
    is_of, log_share, offset, spread = _ways(observation, scales, known, carried)
    every = spread[:, known][:, :, known] + observation.covariance[np.ix_(known, known)]
    _, log_determinant = np.linalg.slogdet(every)
    inverse = np.linalg.inv(every)
    error = mean - offset[:, known]
    log_each = log_share - 0.5 * (log_determinant + np.einsum("hi,hij,hj->h", error, inverse, error))
    log_likelihood = _log_sums(np.where(is_of, log_each, -np.inf))
    inverse = inverse[is_of.argmax(axis=1)]
    estimates, deviations = _shifts(observation, scales, inverse, mean)
    is_losing, is_rising = ndtr(-estimates[PUMP] / deviations[PUMP]), ndtr(estimates[SYSTEM] / deviations[SYSTEM])
    usual_pump = 2.0 * (LOSING_SHARE * is_losing + (1.0 - LOSING_SHARE) * (1.0 - is_losing))
    usual_system = 2.0 * (RISING_SHARE * is_rising + (1.0 - RISING_SHARE) * (1.0 - is_rising))
    log_weight = np.log(prior) + log_likelihood
    log_weight[[PUMP_FAULT, BOTH]] += np.log(usual_pump)
    log_weight[[SYSTEM_FAULT, BOTH]] += np.log(usual_system)
    if not known[SYSTEM]:
        alike = _FAULTS if known[DRAWDOWN] else [*_FAULTS, FLOW_METER]
        log_weight[alike] = (np.log(prior) + log_likelihood[PUMP_FAULT] + np.log(usual_pump))[alike]
        log_weight[HEAD_SENSOR] = -np.inf
    weight = np.exp(log_weight - log_weight.max())
    is_watched = bool(observation.covariance[DRAWDOWN, DRAWDOWN] < FLOW_TRUST**2)
    flow_error, flow_deviation = _meter_error(
        observation.flow_meter[known], FLOW_METER_ERROR**2, inverse[FLOW_METER], mean
    )
    head_error_m, head_deviation_m = _meter_error(
        observation.head_sensor[known], scales.head_m**2, inverse[HEAD_SENSOR], mean
    )
    return Posterior(
        probability=weight / weight.sum(),
        shift_m=estimates,
        deviation_m=deviations,
        tolerance_m=(not is_watched) * FLOW_TRUST * np.abs(observation.flow_meter[[PUMP, SYSTEM]]),
        flow_error=flow_error,
        head_error_m=head_error_m,
        flow_deviation=flow_deviation,
        head_deviation_m=head_deviation_m,
    )


def _shifts(observation: Observation, scales: Scales, inverse: Floats, mean: Floats) -> tuple[Floats, Floats]:
    """Estimates of the shifts of (r_p, r_s) if both may have moved, and their standard deviations. [m].

    Without a head sensor: of each as if it had moved alone.
    """
    tau = np.array([scales.pump_m**2, scales.system_m**2])
    if observation.system_in_pump == 0.0:
        estimates, shares = (inverse[BOTH] @ mean)[: SYSTEM + 1], np.diag(inverse[BOTH])[: SYSTEM + 1]
    else:
        gains = np.array([1.0, observation.system_in_pump])
        alone = inverse[[PUMP_FAULT, SYSTEM_FAULT]]
        estimates, shares = gains * (alone @ mean)[:, PUMP], gains**2 * alone[:, PUMP, PUMP]
    return tau * estimates, np.sqrt(np.maximum(tau - tau**2 * shares, 1e-300))


def _meter_error(direction: Floats, prior_variance: float, inverse: Floats, mean: Floats) -> tuple[float, float]:
    """Error of a meter that is wrong, and its standard deviation."""
    error = prior_variance * float(direction @ inverse @ mean)
    variance = prior_variance - prior_variance**2 * float(direction @ inverse @ direction)
    return error, max(variance, 0.0) ** 0.5
