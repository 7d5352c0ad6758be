"""Inflow beside the metered one."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters


class UnmeteredInflow(Effect):
    r"""Water enters beside the inflow meter, at a constant rate.

    $$A \frac{dL}{dt} = Q_\text{in} + Q_u - \sum_i Q_i$$

    Parameters
    ----------
    flow_m3h : float
        Q_u, inflow that no meter sees; 0 is no effect. [m³/h]

    References
    ----------
    .. [1] After Metcalf & Eddy, Wastewater Engineering: infiltration and inflow.
    """

    component: ClassVar[Component] = "sump"
    has_one_form: ClassVar[bool] = True
    neutral: ClassVar[dict[str, float]] = {"flow_m3h": 0.0}
    may_change: ClassVar[bool] = True

    name: Literal["unmetered_inflow"] = "unmetered_inflow"
    flow_m3h: Annotated[float, limits(0.0, 500.0, "m³/h")]

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Add the flow."""
        return replace(parameters, unmetered_inflow_m3h=parameters.unmetered_inflow_m3h + self.flow_m3h)
