"""Which state explains a run: normal, pump, system, both, or a meter that is wrong."""

from dataclasses import dataclass

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


_CAUSES = (PUMP_FAULT, SYSTEM_FAULT, BOTH, FLOW_METER, HEAD_SENSOR)
_HYPOTHESES = np.array([NORMAL, *_CAUSES * len(SCALES)])
_LOG_SCALE = np.where(_HYPOTHESES == NORMAL, 0.0, -np.log(len(SCALES)))
_MOVES_POWER = np.where(np.isin(_HYPOTHESES, (FLOW_METER, HEAD_SENSOR)), DISTURBED_SHARE, LOAD_SHARE)
_FOLLOWED = np.column_stack([1.0 - _MOVES_POWER, _MOVES_POWER])
"""Share of runs in which the power stays, and in which it moves."""


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


def _ways(observation: Observation, scales: Scales, known: Flags) -> tuple[Integers, Floats, Floats]:
    """(w,) hypothesis, (w,) logarithm of its share in that, (w, 4, 4) covariance of the shift, of each way to shift.

    The first way of each hypothesis is the one at full scale.
    """
    tau_p, tau_s = scales.pump_m**2, scales.system_m**2
    v_p, v_s = observation.slope_variance
    scale = np.array(SCALES)
    spread = np.zeros((len(_HYPOTHESES), 4, 4))
    pump, system, both, flow, head = (spread[1 + cause :: len(_CAUSES)] for cause in range(len(_CAUSES)))
    pump[:, PUMP, PUMP], pump[:, SYSTEM, SYSTEM] = scale * tau_p, v_s
    system[:, PUMP, PUMP], system[:, SYSTEM, SYSTEM] = v_p, scale * tau_s
    both[:, PUMP, PUMP], both[:, SYSTEM, SYSTEM] = scale * tau_p + v_p, scale * tau_s + v_s
    scale = scale[:, np.newaxis, np.newaxis]
    flow[:] = scale * FLOW_METER_ERROR**2 * np.outer(observation.flow_meter, observation.flow_meter)
    head[:] = scale * scales.head_m**2 * np.outer(observation.head_sensor, observation.head_sensor)
    disturbed = (1.0 - DISTURBED_SHARE, DISTURBED_SHARE) if known[DRAWDOWN] else (1.0,)
    ways = np.repeat(spread, 2 * len(disturbed) if known[POWER] else len(disturbed), axis=0)
    ways = ways.reshape(len(_HYPOTHESES), len(disturbed), -1, 4, 4)
    ways[:, 1:, :, DRAWDOWN, DRAWDOWN] += DISTURBED_DRAWDOWN**2
    ways[:, :, 1:, POWER, POWER] += POWER_SHIFT**2
    share = np.array(disturbed)[:, np.newaxis]
    if known[POWER]:
        share = share * _FOLLOWED[:, np.newaxis]
    log_share = _LOG_SCALE[:, np.newaxis, np.newaxis] + np.log(share)
    hypotheses = np.repeat(_HYPOTHESES, ways.shape[1] * ways.shape[2])
    return hypotheses, np.broadcast_to(log_share, ways.shape[:3]).ravel(), ways.reshape(-1, 4, 4)


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


def posterior_of(observation: Observation, scales: Scales, prior: Floats) -> Posterior:
    r"""Probability of each hypothesis after a run.

    $$P(h \mid y) \propto P(h)\; N(y;\ 0,\ C + D_h)\; S_h, \qquad
    D_{fault} = \mathrm{diag}(a_p \tau_p^2 + a_s v_p,\ a_s \tau_s^2 + a_p v_s,\ 0,\ \tau_P^2 \text{ or } 0),
    \qquad D_{meter} = \tau_m^2\, d\, d^T$$

    where a says which of the two curves a fault moves, τ how far, v what the slope of each curve may be wrong by (a
    pump fault moves the flow along the system curve, a system fault along the pump curve), d how a wrong meter moves
    all components, and S how usual the sign of the shift is. Each τ stands for large and for small shifts,
    weighed alike. The power may follow the load or not, or drift: it tells a wrong meter from a fault, but no fault
    from health. In a few runs the drawdown is disturbed by something else and says nothing. Components that are not
    known are left out.

    Parameters
    ----------
    observation : Observation
        y, C, v and d.
    scales : Scales
        τ.
    prior : (6,) array
        P(h).
    """
    known = np.isfinite(observation.mean) & np.isfinite(np.diag(observation.covariance))
    mean = observation.mean[known]
    tau_p, tau_s = scales.pump_m**2, scales.system_m**2
    hypotheses, log_share, spread = _ways(observation, scales, known)
    every = spread[:, known][:, :, known] + observation.covariance[np.ix_(known, known)]
    _, log_determinant = np.linalg.slogdet(every)
    inverse = np.linalg.inv(every)
    log_each = log_share - 0.5 * (log_determinant + np.einsum("i,hij,j->h", mean, inverse, mean))
    is_of = hypotheses == np.arange(HEAD_SENSOR + 1)[:, np.newaxis]
    log_likelihood = _log_sums(np.where(is_of, log_each, -np.inf))
    inverse = inverse[is_of.argmax(axis=1)]
    rows = [int(known[:component].sum()) for component in (PUMP, SYSTEM)]
    estimates = np.array([tau_p, tau_s]) * (inverse[BOTH] @ mean)[rows]
    variances = np.array([tau_p, tau_s]) - np.array([tau_p, tau_s]) ** 2 * np.diag(inverse[BOTH])[rows]
    deviations = np.sqrt(np.maximum(variances, 1e-300))
    is_losing, is_rising = ndtr(-estimates[PUMP] / deviations[PUMP]), ndtr(estimates[SYSTEM] / deviations[SYSTEM])
    usual_pump = 2.0 * (LOSING_SHARE * is_losing + (1.0 - LOSING_SHARE) * (1.0 - is_losing))
    usual_system = 2.0 * (RISING_SHARE * is_rising + (1.0 - RISING_SHARE) * (1.0 - is_rising))
    log_weight = np.log(prior) + log_likelihood
    log_weight[[PUMP_FAULT, BOTH]] += np.log(usual_pump)
    log_weight[[SYSTEM_FAULT, BOTH]] += np.log(usual_system)
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


def _meter_error(direction: Floats, prior_variance: float, inverse: Floats, mean: Floats) -> tuple[float, float]:
    """Error of a meter that is wrong, and its standard deviation."""
    error = prior_variance * float(direction @ inverse @ mean)
    variance = prior_variance - prior_variance**2 * float(direction @ inverse @ direction)
    return error, max(variance, 0.0) ** 0.5
