"""Inertia of the water in the main."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, MainNumber, limits
from wetwell.simulator.parameters import PlantParameters


class WaterInertia(Effect):
    r"""The column of water has to be accelerated and slowed down, as one rigid body.

    $$I \frac{dQ}{dt} = H_\text{pump}(Q) - H_s - k Q^2, \qquad I = \frac{\ell}{g A},\ Q \ge 0,\ Q \text{ in m³/s}$$

    The speed is held over each second; the error of the flow's means is under 0.1 m³/h.

    Parameters
    ----------
    inertia_s2_m2 : float
        I, of length ℓ and cross-section A of the main; 300 m of 0.2 m diameter are 973. 0 is no effect. [s²/m²]
    main : int
        0 for all.

    References
    ----------
    .. [1] After E. B. Wylie, V. L. Streeter, Fluid Transients in Systems: rigid water column.
    """

    component: ClassVar[Component] = "rising_main"
    neutral: ClassVar[dict[str, float]] = {"inertia_s2_m2": 0.0}

    name: Literal["water_inertia"] = "water_inertia"
    inertia_s2_m2: Annotated[float, limits(0.0, 3.0e4, "s²/m²")]
    main: MainNumber = 0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Give the water its inertia."""
        return parameters.with_mains(
            lambda main: replace(main, inertia_s2_m2=main.inertia_s2_m2 + self.inertia_s2_m2), self.main
        )
