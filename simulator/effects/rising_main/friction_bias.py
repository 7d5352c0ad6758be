"""Friction of the rising main other than configured."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, MainNumber, limits
from wetwell.simulator.parameters import PlantParameters


class FrictionBias(Effect):
    r"""The rising main is rougher, smoother, narrower or longer than the station file says; constant in time.

    $$H = H_s + \phi\, k \left((n - 1)\, Q^2 + (2 - n)\, Q_r Q\right)$$

    This touches $\phi\, k\, Q_r^{2 - n} Q^n$ at the rated flow $Q_r$, the mean of the pumps of the main, each alone.
    From half of that flow to one and a half it is off by at most 3 % of the loss at $Q_r$.

    Parameters
    ----------
    factor : float
        φ, friction over that of the station file at the rated flow; 1 is no effect. [1]
    loss_exponent : float
        n, power of the flow with which the loss grows there: 2 in a rough pipe as in the station file, 1.852 by Hazen
        and Williams, 1.75 in a smooth one by Blasius. [1]
    main : int
        0 for all.

    References
    ----------
    .. [1] After G. M. Jones et al., Pumping Station Design: head loss by Darcy and Weisbach, by Hazen and Williams;
       roughness with age.
    """

    component: ClassVar[Component] = "rising_main"
    neutral: ClassVar[dict[str, float]] = {"factor": 1.0, "loss_exponent": 2.0}
    has_one_form: ClassVar[bool] = True
    may_change: ClassVar[bool] = True

    name: Literal["friction_bias"] = "friction_bias"
    factor: Annotated[float, limits(0.2, 5.0, "1")]
    loss_exponent: Annotated[float, limits(1.75, 2.0, "1")] = 2.0
    main: MainNumber = 0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Scale the friction, and let a part of it grow with the flow instead of its square."""
        n = self.loss_exponent
        mains = list(parameters.mains)
        for m, main in enumerate(mains):
            if self.main in {0, m + 1}:
                rated_m3h = [pump.rated_flow_m3h for pump in parameters.pumps if pump.main == m]
                mains[m] = replace(
                    main,
                    friction_h2_m5=main.friction_h2_m5 * self.factor * (n - 1.0),
                    linear_flow_m3h=main.linear_flow_m3h + (2.0 - n) / (n - 1.0) * sum(rated_m3h) / len(rated_m3h),
                )
        return replace(parameters, mains=tuple(mains))
