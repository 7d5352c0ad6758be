"""Electrical power that follows the load."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters


class LoadDependentPower(Effect):
    r"""The electrical power follows the shaft power, where the plain model lets it follow the frequency alone.

    $$P = (1 - \lambda)\, P_f(N) + \lambda\, \gamma\, \frac{P_s(Q, N) + c\, P_n}{(1 + c)\, \eta_m \eta_d}, \qquad
    P_s = N^3 P_n \left(s + (1 - s) \frac{Q}{N Q_n}\right)$$

    Parameters
    ----------
    share : float
        λ, share of the power that follows the load of the shaft; 0 is no effect. [1]
    shutoff_share : float
        s, shaft power at zero flow over the rated one; also shapes the torque under `motor_slip`. [1]
    rated_factor : float
        γ, power at rated load over the one that the configured efficiencies give. [1]

    The constant losses c are .02 where no `constant_losses` tells them.

    References
    ----------
    .. [1] After J. F. Gülich, Centrifugal Pumps, Springer: power curves of radial impellers.
    """

    component: ClassVar[Component] = "drive"
    neutral: ClassVar[dict[str, float]] = {"share": 0.0}

    name: Literal["load_dependent_power"] = "load_dependent_power"
    share: Annotated[float, limits(0.0, 1.0, "1")]
    shutoff_share: Annotated[float, limits(0.0, 1.0, "1")] = 0.4
    rated_factor: Annotated[float, limits(0.5, 2.0, "1")] = 1.0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Mix the two powers."""
        if self.share == 0.0:
            return parameters
        return replace(
            parameters.with_pumps(lambda pump: replace(pump, shutoff_power_share=self.shutoff_share)),
            load_share=parameters.load_share + (1.0 - parameters.load_share) * self.share,
            motor_efficiency=parameters.motor_efficiency / self.rated_factor,
        )
