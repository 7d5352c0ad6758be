"""Check valves that do not close."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters


class CheckValveLeak(Effect):
    r"""Water flows from the main back into the wet well through each standing pump.

    $$Q_\text{back} = K \sqrt{H / 1\,\text{m}}, \qquad H = H_s \text{, on a common header } H_s + k Q |Q|, \quad
    Q = \sum_i Q_i - \sum Q_\text{back}$$

    No meter shows it: the pump's own reads 0 while it stands, and the back flow is no part of the inflow. On a common
    header the running pumps deliver it, too: they carry more, at a lower head, than the main takes. On mains of their
    own they are as without it. The main is taken to stay full.

    Parameters
    ----------
    leak_m3h : float
        K, flow at 1 m; 0 is no effect. [m³/h]

    References
    ----------
    .. [1] After I. E. Idelchik, Handbook of Hydraulic Resistance: flow through an orifice.
    """

    component: ClassVar[Component] = "pump"
    neutral: ClassVar[dict[str, float]] = {"leak_m3h": 0.0}
    may_change: ClassVar[bool] = True
    reach: ClassVar[dict[str, tuple[float, float]]] = {"leak_m3h": (50.0, 0.1)}

    name: Literal["check_valve_leak"] = "check_valve_leak"
    leak_m3h: Annotated[float, limits(0.0, 500.0, "m³/h")]

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Let the valves leak."""
        return parameters.with_pumps(lambda pump: replace(pump, valve_leak_m3h=pump.valve_leak_m3h + self.leak_m3h))
