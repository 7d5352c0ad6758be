"""Damped flow meters."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters, followed_share


class FlowMeterLag(Effect):
    r"""Every pump's flow meter follows with a first-order lag.

    $$\tau \frac{dy}{dt} = Q - y$$

    Parameters
    ----------
    lag_s : float
        τ, time in which the reading makes up 63 % of a change; 0 is no effect. [s]

    References
    ----------
    .. [1] After J. P. Bentley, Principles of Measurement Systems: first-order elements.
    """

    component: ClassVar[Component] = "flow_meter"
    neutral: ClassVar[dict[str, float]] = {"lag_s": 0.0}

    name: Literal["flow_meter_lag"] = "flow_meter_lag"
    lag_s: Annotated[float, limits(0.0, 120.0, "s")]

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Damp the flows."""
        return parameters.with_sensors(
            lambda sensor: replace(sensor, followed=followed_share(self.lag_s)), "flow_m3h"
        )
