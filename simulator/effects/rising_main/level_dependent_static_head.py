"""Lift that falls as the wet well fills."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, MainNumber, limits
from wetwell.simulator.parameters import PlantParameters


class LevelDependentStaticHead(Effect):
    r"""The static head is counted from the water in the wet well, not from a fixed level.

    $$H_s(L) = H_{s,0} - s\,(L - L_r), \qquad H_s(L) \ge 0$$

    It comes on top of what a configured delivery level does.

    Parameters
    ----------
    slope : float
        s, fall of the static head for each metre that the water rises; 1 is geometry, 0 is no effect. [m/m]
    reference_level_m : float
        L_r, level at which the static head is the configured one. [m]
    main : int
        0 for all.

    References
    ----------
    .. [1] After G. M. Jones et al., Pumping Station Design: static head between the two water levels.
    """

    component: ClassVar[Component] = "rising_main"
    neutral: ClassVar[dict[str, float]] = {"slope": 0.0}

    name: Literal["level_dependent_static_head"] = "level_dependent_static_head"
    slope: Annotated[float, limits(0.0, 2.0, "m/m")]
    reference_level_m: Annotated[float, limits(0.0, 20.0, "m")] = 0.0
    main: MainNumber = 0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Let the lift follow the level."""
        return parameters.with_mains(
            lambda main: replace(main, lift_slope=self.slope, lift_reference_m=self.reference_level_m), self.main
        )
