"""Friction of the rising main other than configured."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, MainNumber, limits
from wetwell.simulator.parameters import PlantParameters


class FrictionBias(Effect):
    r"""The rising main is rougher, narrower or longer than the station file says; constant in time.

    $$H = H_s + \phi\, k\, Q^2$$

    Parameters
    ----------
    factor : float
        φ, friction over that of the station file; 1 is no effect. [1]
    main : int
        0 for all.

    References
    ----------
    .. [1] After G. M. Jones et al., Pumping Station Design: head loss by Darcy and Weisbach; roughness with age.
    """

    component: ClassVar[Component] = "rising_main"
    neutral: ClassVar[dict[str, float]] = {"factor": 1.0}
    may_change: ClassVar[bool] = True

    name: Literal["friction_bias"] = "friction_bias"
    factor: Annotated[float, limits(0.2, 5.0, "1")]
    main: MainNumber = 0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Scale the friction."""
        return parameters.with_mains(
            lambda main: replace(main, friction_h2_m5=main.friction_h2_m5 * self.factor), self.main
        )
