"""Which state explains a run: normal, pump, system, both, or a meter that is wrong."""

from dataclasses import dataclass
from functools import cache
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
    """Ways to shift, w of them: each hypothesis at each scale, with each way to disturb its witnesses.

    Attributes
    ----------
    new : (w, 2) array
        Variances of new shifts of both curves, as shares of that of the usual fault.
    moves, is_old : (w, 2) arrays
        Which curves it moves, and which of them as far as the fault that is carried.
    slopes : (w, 2) array
        Of which curve the slope counts: the flow was moved along it, or what is carried was seen at another flow.
    meter_scale : (w,) array
        Variance of the error of the meter, as a share of the usual one.
    flow, head : arrays
        Ways of either meter.
    witnesses : (w, 2) array
        Variances of what disturbs drawdown and power.
    log_share, log_witnesses : (w,) arrays
        Of the share of its scale, and of its witnesses, in its hypothesis.
    is_of : (6, w) array
        Of which hypothesis it is.
    first : (6,) array
        The way of each hypothesis at full scale, of which no witness is disturbed.
    """

    new: Floats
    moves: Flags
    is_old: Flags
    slopes: Flags
    meter_scale: Floats
    flow: Integers
    head: Integers
    witnesses: Floats
    log_share: Floats
    log_witnesses: Floats
    is_of: Flags
    first: Integers


@cache
def _table(*, carried: bool, drawdown: bool, power: bool) -> _Table:
    """Ways of new faults, of each hypothesis the one at full scale before the others, then those that are carried.

    Whether the drawdown and the power are known says in how many ways the witnesses may be disturbed.
    """
    rows: list[tuple[int, float, float, bool, bool]] = [(NORMAL, 0.0, 0.0, False, False)]
    for scale in SCALES:
        rows += [(PUMP_FAULT, scale, 0.0, False, False), (SYSTEM_FAULT, 0.0, scale, False, False)]
        rows += [(cause, scale, scale, False, False) for cause in (BOTH, FLOW_METER, HEAD_SENSOR)]
    if carried:
        rows += [(PUMP_FAULT, 0.0, 0.0, True, False), (SYSTEM_FAULT, 0.0, 0.0, False, True)]
        for scale in SCALES:
            rows += [(BOTH, 0.0, scale, True, False), (BOTH, scale, 0.0, False, True)]
        rows.append((BOTH, 0.0, 0.0, True, True))
    causes = np.array([row[0] for row in rows])
    disturbed = np.array([1.0 - DISTURBED_SHARE, DISTURBED_SHARE] if drawdown else [1.0])
    moving = np.where(causes < FLOW_METER, LOAD_SHARE, DISTURBED_SHARE)
    powers = np.column_stack([1.0 - moving, moving]) if power else np.ones((len(rows), 1))
    share = disturbed[:, np.newaxis] * powers[:, np.newaxis]
    witnesses = np.zeros((*share.shape, 2))
    witnesses[:, 1:, :, 0] = DISTURBED_DRAWDOWN**2
    witnesses[:, :, 1:, 1] = POWER_SHIFT**2
    way = np.repeat(np.arange(len(rows)), share[0].size)
    hypotheses, scales = causes[way], np.array([row[1:3] for row in rows])[way]
    moves = np.column_stack([np.isin(hypotheses, (PUMP_FAULT, BOTH)), np.isin(hypotheses, (SYSTEM_FAULT, BOTH))])
    is_old = np.array([row[3:] for row in rows])[way]
    is_of = hypotheses == np.arange(HEAD_SENSOR + 1)[:, np.newaxis]
    return _Table(
        new=moves * scales,
        moves=moves,
        is_old=is_old,
        slopes=moves[:, ::-1] | is_old,
        meter_scale=scales[:, 0],
        flow=np.flatnonzero(hypotheses == FLOW_METER),
        head=np.flatnonzero(hypotheses == HEAD_SENSOR),
        witnesses=witnesses.reshape(-1, 2),
        log_share=np.where(scales.any(axis=1), -np.log(len(SCALES)), 0.0),
        log_witnesses=np.log(share).ravel(),
        is_of=is_of,
        first=is_of.argmax(axis=1),
    )


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
    observation: Observation, scales: Scales, table: _Table, carried: Carried | None
) -> tuple[Floats, Floats, Floats]:
    """Each way to shift: (w,) log of its share in its hypothesis, (w, 4) mean, (w, 4, 4) spread."""
    log_share = table.log_share
    offset, spread = np.zeros((len(log_share), 4)), np.zeros((len(log_share), 4, 4))
    tau = np.array([scales.pump_m**2, scales.system_m**2])
    variance = table.new * tau
    variance[:, PUMP] += variance[:, SYSTEM] * observation.system_in_pump**2
    variance += table.slopes * observation.slope_variance
    if carried is not None:
        offset[:, : SYSTEM + 1] = table.is_old * carried.mean_m
        variance += table.is_old * carried.variance_m2
        log_old, log_new = np.log(np.maximum([carried.share, 1.0 - carried.share], 1e-300))
        log_share = log_share + (np.where(table.is_old, log_old, log_new) * table.moves).sum(axis=1)
    spread[:, PUMP, PUMP], spread[:, SYSTEM, SYSTEM] = variance.T
    for meter, meter_variance, way in (
        (table.flow, FLOW_METER_ERROR**2, observation.flow_meter),
        (table.head, scales.head_m**2, observation.head_sensor),
    ):
        meter_scale = table.meter_scale[meter, np.newaxis, np.newaxis]
        spread[meter] = meter_scale * meter_variance * (way[:, np.newaxis] * way)
    spread[:, DRAWDOWN, DRAWDOWN] += table.witnesses[:, 0]
    spread[:, POWER, POWER] += table.witnesses[:, 1]
    return log_share + table.log_witnesses, offset, spread


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
    known = np.isfinite(observation.mean) & np.isfinite(observation.covariance.diagonal())
    mean = observation.mean[known]
    table = _table(carried=carried is not None, drawdown=bool(known[DRAWDOWN]), power=bool(known[POWER]))
    log_share, offset, spread = _ways(observation, scales, table, carried)
    every = (spread + observation.covariance).compress(known, axis=1).compress(known, axis=2)
    _, log_determinant = np.linalg.slogdet(every)
    inverse = np.linalg.inv(every)
    error = mean - offset.compress(known, axis=1)
    log_each = log_share - 0.5 * (log_determinant + np.einsum("hi,hij,hj->h", error, inverse, error))
    log_likelihood = _log_sums(np.where(table.is_of, log_each, -np.inf))
    inverse = inverse[table.first]
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
        estimates, shares = (inverse[BOTH] @ mean)[: SYSTEM + 1], inverse[BOTH].diagonal()[: SYSTEM + 1]
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
