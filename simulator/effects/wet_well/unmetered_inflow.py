"""Inflow beside the metered one."""

import math
from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters


class UnmeteredInflow(Effect):
    r"""Water enters beside the inflow meter, at a constant rate, or at one that swings with the day.

    $$A \frac{dL}{dt} = Q_\text{in} + Q_u \left(1 + a_d \cos\left(2 \pi \frac{t - t_d}{24\,\text{h}}\right)\right)
    - \sum_i Q_i$$

    Time is that of the day, in UTC.

    Parameters
    ----------
    flow_m3h : float
        Q_u, mean of the inflow that no meter sees; 0 is no effect. [m³/h]
    daily_share : float
        a_d, share by which it swings over the day; 0 is constant. Below 0 it is least at t_d. [1]
    daily_phase_h : float
        t_d, hour of the day at which it is highest. [h]

    References
    ----------
    .. [1] After Metcalf & Eddy, Wastewater Engineering: infiltration and inflow, and its course over a dry day, with
           a high in the later morning.
    """

    component: ClassVar[Component] = "sump"
    has_one_form: ClassVar[bool] = True
    neutral: ClassVar[dict[str, float]] = {"flow_m3h": 0.0}
    may_change: ClassVar[bool] = True

    name: Literal["unmetered_inflow"] = "unmetered_inflow"
    flow_m3h: Annotated[float, limits(0.0, 500.0, "m³/h")]
    daily_share: Annotated[float, limits(-1.0, 1.0, "1")] = 0.0
    daily_phase_h: Annotated[float, limits(0.0, 24.0, "h")] = 10.0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Add the flow, and its swing."""
        swing_m3h, angle = self.daily_share * self.flow_m3h, 2.0 * math.pi * self.daily_phase_h / 24.0
        return replace(
            parameters,
            unmetered_inflow_m3h=parameters.unmetered_inflow_m3h + self.flow_m3h,
            unmetered_cosine_m3h=parameters.unmetered_cosine_m3h + swing_m3h * math.cos(angle),
            unmetered_sine_m3h=parameters.unmetered_sine_m3h + swing_m3h * math.sin(angle),
        )
