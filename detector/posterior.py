"""Which state explains a run: normal, pump, system, or both."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wetwell.detector.baseline import Baseline
from wetwell.detector.nominal import Nominal
from wetwell.detector.runs import Run
from wetwell.protocols.messages import State

Floats = npt.NDArray[np.float64]

STATES: tuple[State, ...] = ("normal", "pump_fault", "system_fault", "pump_and_system_fault")
FAULTS = STATES[1:]
_AFFECTED = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], dtype=float)

PRIOR = np.array([0.90, 0.045, 0.045, 0.01])
CHANGE_PER_RUN = 0.05
SLOPE_SHARE = 0.2
"""Standard deviation of the datasheet's slopes, as a share of each."""
HEALTHY_FLOW_SHARE = 0.01
"""How far level, speed and meter move the flow of a healthy pump, as a share of it."""
PUMP_SHIFT_SHARE = 0.15
SYSTEM_SHIFT_SHARE = 0.3
SYSTEM_SHIFT_M = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Shift:
    """How far a run lies from the baseline.

    Attributes
    ----------
    mean_m : (2,) array
        Shift of (r_p, r_s). [m]
    covariance : (2, 2) array
        Of that mean if nothing has changed: noise, floor, and what the datasheet's slopes may be wrong by over the
        way that the flow of a healthy pump goes. [m²]
    slope_variance : (2,) array
        More of it where a fault has moved the flow: what the slopes may be wrong by over the rest of the way. [m²]
    """

    mean_m: Floats
    covariance: Floats
    slope_variance: Floats

    @property
    def sigmas(self) -> Floats:
        """(2,) shift over its standard deviation."""
        return self.mean_m / np.sqrt(np.diag(self.covariance))


def shift_of(run: Run, baseline: Baseline, curve: tuple[float, float, float], friction_h2_m5: float) -> Shift:
    """Shift of a run with at least one segment.

    The median over its segments, whose variance is π/2 times that of the mean: a run in which something comes or goes
    is told by its longer part, and a burst within it does not tell.
    """
    flow_m3h = float(np.median(run.flow_m3h / run.speed_ratio))
    total_m3h = float(np.median(run.total_flow_m3h))
    slope_variance = SLOPE_SHARE**2 * np.array(
        [
            (curve[1] * (flow_m3h - baseline.flow_m3h)) ** 2 + (curve[2] * (flow_m3h**2 - baseline.flow_m3h**2)) ** 2,
            (friction_h2_m5 * (total_m3h**2 - baseline.total_m3h**2)) ** 2,
        ]
    )
    healthy_variance = slope_variance * _healthy_share(flow_m3h, total_m3h, baseline) ** 2
    return Shift(
        mean_m=np.median(run.segments, axis=0) - baseline.offset_m,
        covariance=baseline.segment_covariance * (np.pi / 2.0 / len(run.segments))
        + np.diag(baseline.run_variance + healthy_variance),
        slope_variance=slope_variance - healthy_variance,
    )


def _healthy_share(flow_m3h: float, total_m3h: float, baseline: Baseline) -> float:
    """Share of the way of the flow from the baseline that the other pumps on the main, or no fault, explain."""
    others_m3h = (total_m3h - flow_m3h) - (baseline.total_m3h - baseline.flow_m3h)
    explained_m3h = abs(others_m3h) + HEALTHY_FLOW_SHARE * baseline.flow_m3h
    moved_m3h = max(abs(flow_m3h - baseline.flow_m3h), abs(total_m3h - baseline.total_m3h))
    return min(1.0, explained_m3h / moved_m3h) if moved_m3h > 0.0 else 1.0


def shift_scales_m(nominal: Nominal, pump: int, baseline: Baseline) -> Floats:
    """(2,) standard deviations of the shifts that faults bring, before anything is seen. [m]."""
    return np.array(
        [
            PUMP_SHIFT_SHARE * nominal.curves[pump][0],
            SYSTEM_SHIFT_SHARE * nominal.friction_h2_m5 * baseline.total_m3h**2 + SYSTEM_SHIFT_M,
        ]
    )


def posterior(shift: Shift, scales_m: Floats, prior: Floats) -> Floats:
    r"""Probability of each of `STATES` after a run.

    $$P(s \mid r) \propto P(s)\; N(r;\ 0,\ C + D_s), \qquad
    D_s = \mathrm{diag}(a_p \tau_p^2 + a_s v_p,\ a_s \tau_s^2 + a_p v_s)$$

    where a says which of the two curves state s moves, τ how far faults move them, and v what the slope of each curve
    may be wrong by: a pump fault moves the flow along the system curve, a system fault along the pump curve.

    Parameters
    ----------
    shift : Shift
        r, C and v.
    scales_m : (2,) array
        τ. [m]
    prior : (4,) array
        P(s).

    Returns
    -------
    probability : (4,) array
        Sums to one.
    """
    log_weight = np.log(prior)
    for state, affected in enumerate(_AFFECTED):
        moved = affected * scales_m**2 + affected[::-1] * shift.slope_variance
        covariance = shift.covariance + np.diag(moved)
        _, log_determinant = np.linalg.slogdet(covariance)
        distance = shift.mean_m @ np.linalg.solve(covariance, shift.mean_m)
        log_weight[state] -= 0.5 * (log_determinant + distance)
    weight = np.exp(log_weight - log_weight.max())
    probability: Floats = weight / weight.sum()
    return probability


def prior_of_next_run(probability: Floats) -> Floats:
    """Prior of the next run: the last posterior, mixed with how faults come and go between runs."""
    return (1.0 - CHANGE_PER_RUN) * probability + CHANGE_PER_RUN * PRIOR
