"""Low-flow cutoff of the flow meters."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters


class FlowLowCutoff(Effect):
    r"""Every pump's flow meter reads 0 below a flow.

    $$y = \begin{cases} 0 & Q < Q_c \\ Q & Q \ge Q_c \end{cases}$$

    Parameters
    ----------
    cutoff_m3h : float
        Q_c, flow below which the meter reads 0; 0 is no effect. [m³/h]

    References
    ----------
    .. [1] After R. C. Baker, Flow Measurement Handbook, Cambridge University Press: electromagnetic meters, low flow.
    """

    component: ClassVar[Component] = "flow_meter"
    neutral: ClassVar[dict[str, float]] = {"cutoff_m3h": 0.0}
    is_limit: ClassVar[bool] = True
    reach: ClassVar[dict[str, tuple[float, float]]] = {"cutoff_m3h": (200.0, 1.0)}

    name: Literal["flow_low_cutoff"] = "flow_low_cutoff"
    cutoff_m3h: Annotated[float, limits(0.0, 5000.0, "m³/h")]

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Cut low flows off."""
        if self.cutoff_m3h == 0.0:
            return parameters
        return parameters.with_sensors(lambda sensor: replace(sensor, cutoff=self.cutoff_m3h), "flow_m3h")
