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
_AFFECTED = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], dtype=float)

PRIOR = np.array([0.90, 0.045, 0.045, 0.01])
CHANGE_PER_RUN = 0.02
SLOPE_SHARE = 0.2
"""Standard deviation of the datasheet's slopes, as a share of each."""
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
        Of that mean if nothing has changed: noise, floor, and what the datasheet's slopes may be wrong by. [m²]
    """

    mean_m: Floats
    covariance: Floats

    @property
    def sigmas(self) -> Floats:
        """(2,) shift over its standard deviation."""
        return self.mean_m / np.sqrt(np.diag(self.covariance))


def shift_of(run: Run, baseline: Baseline, curve: tuple[float, float, float], friction_h2_m5: float) -> Shift:
    """Shift of a run with at least one segment."""
    flow = run.flow_m3h / run.speed_ratio
    slopes = (
        (curve[1] * (flow.mean() - baseline.flow_m3h)) ** 2
        + (curve[2] * (np.mean(flow**2) - baseline.flow_squared)) ** 2,
        (friction_h2_m5 * (np.mean(run.total_flow_m3h**2) - baseline.total_squared)) ** 2,
    )
    variance = baseline.run_variance + SLOPE_SHARE**2 * np.array(slopes)
    return Shift(
        mean_m=run.segments.mean(axis=0) - baseline.offset_m,
        covariance=baseline.segment_covariance / len(run.segments) + np.diag(variance),
    )


def shift_scales_m(nominal: Nominal, pump: int, baseline: Baseline) -> Floats:
    """(2,) standard deviations of the shifts that faults bring, before anything is seen. [m]."""
    return np.array(
        [
            PUMP_SHIFT_SHARE * nominal.curves[pump][0],
            SYSTEM_SHIFT_SHARE * nominal.friction_h2_m5 * baseline.total_squared + SYSTEM_SHIFT_M,
        ]
    )


def posterior(shift: Shift, scales_m: Floats, prior: Floats) -> Floats:
    r"""Probability of each of `STATES` after a run.

    $$P(s \mid r) \propto P(s)\; N(r;\ 0,\ C + D_s), \qquad D_s = \mathrm{diag}(a_s \tau^2)$$

    where a_s says which of the two curves state s moves, and τ how far faults move them.

    Parameters
    ----------
    shift : Shift
        r and C.
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
        covariance = shift.covariance + np.diag(affected * scales_m**2)
        _, log_determinant = np.linalg.slogdet(covariance)
        distance = shift.mean_m @ np.linalg.solve(covariance, shift.mean_m)
        log_weight[state] -= 0.5 * (log_determinant + distance)
    weight = np.exp(log_weight - log_weight.max())
    probability: Floats = weight / weight.sum()
    return probability


def prior_of_next_run(probability: Floats) -> Floats:
    """Prior of the next run: the last posterior, mixed with how faults come and go between runs."""
    return (1.0 - CHANGE_PER_RUN) * probability + CHANGE_PER_RUN * PRIOR
