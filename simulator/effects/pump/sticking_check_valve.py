"""Check valves that stick."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, PumpNumber, limits
from wetwell.simulator.parameters import PlantParameters


class StickingCheckValve(Effect):
    r"""A check valve opens late: its flap stays on its seat until the pump exceeds the head behind it by a good deal.

    $$Q = 0 \quad \text{until} \quad c_0 N^2 > H_s + H_o, \qquad \text{on a common header } H_s + k Q |Q| + H_o$$

    Then it swings open, and is open until no more water flows. A pump that cannot exceed that head moves no water.

    Parameters
    ----------
    opening_m : float
        H_o, head over that behind the valve which first opens it; 0 is no effect. [m]
    pump : int
        0 for all.

    References
    ----------
    .. [1] After A. R. D. Thorley, Fluid Transients in Pipeline Systems, D. & L. George: check valves.
    """

    component: ClassVar[Component] = "pump"
    neutral: ClassVar[dict[str, float]] = {"opening_m": 0.0}
    is_limit: ClassVar[bool] = True
    may_change: ClassVar[bool] = True

    name: Literal["sticking_check_valve"] = "sticking_check_valve"
    opening_m: Annotated[float, limits(0.0, 50.0, "m")]
    pump: PumpNumber = 0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Let the flaps stick."""
        return parameters.with_pumps(
            lambda pump: replace(pump, valve_opening_m=pump.valve_opening_m + self.opening_m), self.pump
        )
