"""Losses that do not depend on the load."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters
from wetwell.simulator.power import STANDING_LOSS_SHARE


class ConstantLosses(Effect):
    r"""Motor and drive lose another share of the rated power whatever the load is; those at rated load stay.

    $$P = \frac{P_s + c\, P_n}{(1 + c)\, \eta_m \eta_d}$$

    They show where a pump turns slowly: in starts and stops, and under a level controller. Each drive has some, and a
    datasheet seldom tells them, so that a diagnosis sizes them beside what it tells and never tells them.

    Parameters
    ----------
    losses_share : float
        c, constant losses over the rated shaft power: cooling, control and magnetising. [1]

    References
    ----------
    .. [1] IEC 61800-9-2, Adjustable speed electrical power drive systems: losses at eight operating points.
    """

    component: ClassVar[Component] = "drive"
    neutral: ClassVar[dict[str, float]] = {"losses_share": STANDING_LOSS_SHARE}
    is_everywhere: ClassVar[bool] = True
    is_told: ClassVar[bool] = False

    name: Literal["constant_losses"] = "constant_losses"
    losses_share: Annotated[float, limits(0.0, 0.2, "1")]

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Set the share."""
        return replace(parameters, losses_share=self.losses_share)
