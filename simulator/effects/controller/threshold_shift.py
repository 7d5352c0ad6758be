"""Start and stop levels other than configured."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.protocols.station.control import check_levels
from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters


class ThresholdShift(Effect):
    r"""The PLC holds other start levels, stop levels or both than the station file says.

    $$S_n' = S_n + \Delta_S, \qquad E_n' = E_n + \Delta_E, \qquad E_n' < S_n'$$

    Parameters
    ----------
    start_m : float
        Δ_S, how much higher pumps start; 0 is none. [m]
    stop_m : float
        Δ_E, how much higher pumps stop; 0 is none. [m]

    References
    ----------
    .. [1] After G. M. Jones et al., Pumping Station Design: set points of level control.
    """

    component: ClassVar[Component] = "controller"
    has_one_form: ClassVar[bool] = True
    neutral: ClassVar[dict[str, float]] = {"start_m": 0.0, "stop_m": 0.0}

    name: Literal["threshold_shift"] = "threshold_shift"
    start_m: Annotated[float, limits(-2.0, 2.0, "m")] = 0.0
    stop_m: Annotated[float, limits(-2.0, 2.0, "m")] = 0.0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Shift the levels.

        Raises
        ------
        ValueError
            If a stop level would not lie under its start level.
        """
        start_m = parameters.start_levels_m + self.start_m
        stop_m = parameters.stop_levels_m + self.stop_m
        try:
            check_levels(tuple(start_m.tolist()), tuple(stop_m.tolist()))
        except ValueError as error:
            raise ValueError(
                f"threshold_shift: with start_m = {self.start_m:g}, stop_m = {self.stop_m:g}: {error}"
            ) from error
        return replace(parameters, start_levels_m=start_m, stop_levels_m=stop_m)
