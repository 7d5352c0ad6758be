"""Static head other than configured."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, MainNumber, limits
from wetwell.simulator.parameters import PlantParameters


class StaticHeadBias(Effect):
    r"""The receiving water stands higher or lower than the station file says; constant in time.

    $$H = H_s + \Delta H_s + k Q^2, \qquad H_s + \Delta H_s \ge 0$$

    A main that has nothing to lift is no rising main: the low end of the range is another station.

    Parameters
    ----------
    offset_m : float
        ΔH_s, what the static head has more than the station file says; 0 is no effect. [m]
    main : int
        0 for all.

    References
    ----------
    .. [1] After G. M. Jones et al., Pumping Station Design: static head and its changes.
    """

    component: ClassVar[Component] = "rising_main"
    has_one_form: ClassVar[bool] = True
    neutral: ClassVar[dict[str, float]] = {"offset_m": 0.0}
    another_at: ClassVar[dict[str, Literal["low", "high"]]] = {"offset_m": "low"}

    name: Literal["static_head_bias"] = "static_head_bias"
    offset_m: Annotated[float, limits(-10.0, 20.0, "m")]
    main: MainNumber = 0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Shift the static head."""
        return parameters.with_mains(
            lambda main: replace(main, static_head_m=main.static_head_m + self.offset_m), self.main
        )
