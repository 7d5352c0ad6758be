"""One regularised fit of a main: the curves of its pumps, its lift and friction, with the datasheets as prior."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.sim2real.calibration.fit.main_model import MainModel
from wetwell.sim2real.calibration.fit.prior import Prior
from wetwell.sim2real.calibration.fit.regularised_fit import Posterior, regularised_fit


@dataclass(frozen=True, slots=True, kw_only=True)
class Witness:
    """Measured values of one quantity that the model is held against.

    Attributes
    ----------
    quantity : "flow" or "head"
    point, pump : (n,) int arrays
        Row and column of the model's duties.
    run : (n,) int array
        Run of each value, from 0 without a gap.
    value : (n,) array
        Positive. [m³/h or m]
    """

    quantity: Literal["flow", "head"]
    point: Integers
    pump: Integers
    run: Integers
    value: Floats


def witness_of(quantity: Literal["flow", "head"], values: Floats, runs: Integers) -> Witness | None:
    """Witness of (n, pumps) values, or None where none is known; `runs` number those of each pump."""
    point, pump = np.nonzero(np.isfinite(values))
    if point.size == 0:
        return None
    return Witness(
        quantity=quantity, point=point, pump=pump, run=numbered(runs[point, pump], pump), value=values[point, pump]
    )


def numbered(run: Integers, pump: Integers) -> Integers:
    """Runs of all pumps, counted from 0 without a gap."""
    _, number = np.unique(np.stack([run, pump]), axis=1, return_inverse=True)
    return np.asarray(number).ravel()


def fit_main(model: MainModel, witnesses: Sequence[Witness], prior: Prior) -> Posterior:
    r"""Parameters of a main from what its pumps gave at known speeds and levels.

    $$e = y_\text{model}(\theta; N, L) / y - 1 \qquad \text{for } y = Q_i \text{ and, where measured, } H_i$$

    Flow and head are both held against speed and lift, which carry hardly any noise: a curve through measured flows
    and heads would take the noise of the flow for a slope. Flow can be lost, to rags, and not gained. See
    `regularised_fit` for the rest.
    """

    def errors(parameters: Floats) -> list[tuple[Floats, Floats]]:
        flow_m3h, head_m = model.duties(parameters)
        of_flow, of_head = model.slopes(parameters, flow_m3h, head_m)
        told = {"flow": (flow_m3h, of_flow), "head": (head_m, of_head)}
        result = []
        for witness in witnesses:
            duty, slope = told[witness.quantity]
            place = witness.point, witness.pump
            result.append((duty[place] / witness.value - 1.0, slope[place] / witness.value[:, None]))
        return result

    are_flows = [witness.quantity == "flow" for witness in witnesses]
    return regularised_fit(errors, [witness.run for witness in witnesses], are_flows, prior)
