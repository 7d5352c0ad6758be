"""What pumps on a rising main give at given speeds and lift, and how that moves with the curves and the main."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.simulator.hydraulics import main_flows

SHIFT, FRICTION = -2, -1
"""Places of the shift of the lift and of the friction in the parameters of a main; before them the pumps' scales."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MainModel:
    r"""Pumps of one main whose curves are affine changes of those of the datasheets.

    $$H = a_i\, H_i(Q / b_i, N), \qquad H = H_s + s + k Q_\Sigma^2$$

    Parameters are (2 pumps + 2,): a of each pump, b of each pump, s [m] and k [h²/m⁵].

    Attributes
    ----------
    curves : (pumps, 3) array
        Coefficients of the datasheets at nominal speed. [m, m/(m³/h), m/(m³/h)²]
    is_common : bool
        Whether friction acts on the total flow, or on that of each pump.
    speed_ratio : (n, pumps) array
        Frequency over nominal frequency; 0 stands. [1]
    lift_m : (n,) array
        Static head of the file at the level of each point. [m]
    """

    curves: Floats
    is_common: bool
    speed_ratio: Floats
    lift_m: Floats

    @property
    def pumps(self) -> int:
        """Number of pumps."""
        return int(self.curves.shape[0])

    def changed_curves(self, parameters: Floats) -> Floats:
        """(pumps, 3) coefficients under parameters. [m, m/(m³/h), m/(m³/h)²]."""
        head, flow = parameters[: self.pumps, None], parameters[self.pumps : SHIFT, None]
        changed: Floats = head * self.curves / np.hstack([flow**0, flow, flow**2])
        return changed

    def duties(self, parameters: Floats) -> tuple[Floats, Floats]:
        """Flow and head of each pump: two (n, pumps) arrays, 0 of one that stands or gives nothing. [m³/h, m]."""
        curves = np.ascontiguousarray(self.changed_curves(parameters))
        flow_m3h = np.zeros_like(self.speed_ratio)
        lift_m = self.lift_m + parameters[SHIFT]
        friction_h2_m5 = float(parameters[FRICTION])
        pumps = np.arange(self.pumps)
        sound = np.zeros(self.pumps)
        main_flows(pumps, curves, self.speed_ratio, lift_m, 0.0, friction_h2_m5, 0.0, self.is_common, sound, flow_m3h)
        speed = self.speed_ratio
        head_m = curves[:, 0] * speed**2 + curves[:, 1] * speed * flow_m3h + curves[:, 2] * flow_m3h**2
        return flow_m3h, np.where(flow_m3h > 0.0, head_m, 0.0)

    def slopes(self, parameters: Floats, flow_m3h: Floats, head_m: Floats) -> tuple[Floats, Floats]:
        r"""Slopes of the duties over the parameters, by the theorem of the implicit function.

        With $g_i(h)$ the flow of a pump at head h, $\partial g / \partial a = -H / (a H')$,
        $\partial g / \partial b = Q / b$, and on a common header

        $$\frac{dh}{d\theta} = \frac{\partial_\theta H_s + Q_\Sigma^2\, \partial_\theta k
        + 2 k Q_\Sigma \sum_i \partial_\theta g_i}{1 - 2 k Q_\Sigma \sum_i g_i'}$$

        Returns
        -------
        of_flow, of_head : (n, pumps, parameters) arrays
            0 where a pump gives nothing.
        """
        pumps = self.pumps
        curves = self.changed_curves(parameters)
        gives = flow_m3h > 0.0
        fall = curves[:, 1] * self.speed_ratio + 2.0 * curves[:, 2] * flow_m3h
        steepness = np.where(gives, 1.0 / np.where(gives, fall, -1.0), 0.0)
        own = np.zeros((*flow_m3h.shape, parameters.size))
        for i in range(pumps):
            own[:, i, i] = -head_m[:, i] / parameters[i] * steepness[:, i]
            own[:, i, pumps + i] = flow_m3h[:, i] / parameters[pumps + i]
        friction = parameters[FRICTION]
        if self.is_common:
            loaded_m3h = np.repeat(flow_m3h.sum(axis=1)[:, None], pumps, axis=1)
            moved = np.repeat(own.sum(axis=1)[:, None, :], pumps, axis=1)
            softness = np.repeat(steepness.sum(axis=1)[:, None], pumps, axis=1)
        else:
            loaded_m3h, moved, softness = flow_m3h, own, steepness
        of_head = 2.0 * friction * loaded_m3h[:, :, None] * moved
        of_head[:, :, SHIFT] += 1.0
        of_head[:, :, FRICTION] += loaded_m3h**2
        of_head /= (1.0 - 2.0 * friction * loaded_m3h * softness)[:, :, None]
        of_head *= gives[:, :, None]
        return own + steepness[:, :, None] * of_head, of_head
