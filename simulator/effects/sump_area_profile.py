"""Cross-section of the wet well that changes with the level."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

import numpy as np

from wetwell.simulator import layout as at
from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.plant import PlantParameters
from wetwell.simulator.wet_well import profile_of


class SumpAreaProfile(Effect):
    r"""The wet well is a cone, has benches at its floor, or walls that lean.

    $$A(L) = A_0(L)
    \begin{cases} b & L < s h \\ b + (1 - b)\, (L / h - s) / (1 - s) & s h \le L < h \\
    1 + (t - 1) \min(L / h - 1,\ 1) & L \ge h \end{cases}$$

    Of a configured profile the area is scaled at its points, and stays linear between them.

    Parameters
    ----------
    bottom_factor : float
        b, area at the floor over the configured one. [1]
    height_m : float
        h, level at which the area is the configured one. [m]
    upright_share : float
        s, share of h up to which the walls stand upright: 0 for a cone, towards 1 for a bench. [1]
    top_factor : float
        t, area at 2 h and above over the configured one; with 2 - b the walls lean evenly. [1]

    References
    ----------
    .. [1] After ANSI/HI 9.8, Rotodynamic Pumps for Pump Intake Design: sloped and confined wet wells for solids.
    """

    component: ClassVar[Component] = "sump"
    neutral: ClassVar[dict[str, float]] = {"bottom_factor": 1.0, "top_factor": 1.0}
    is_shaped: ClassVar[bool] = True

    name: Literal["sump_area_profile"] = "sump_area_profile"
    bottom_factor: Annotated[float, limits(0.1, 4.0, "1")]
    height_m: Annotated[float, limits(0.1, 10.0, "m")] = 1.0
    upright_share: Annotated[float, limits(0.0, 0.95, "1")] = 0.0
    top_factor: Annotated[float, limits(0.1, 4.0, "1")] = 1.0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Scale the area along the profile."""
        if self.bottom_factor == self.top_factor == 1.0:
            return parameters
        knots_m = self.height_m * np.array([0.0, self.upright_share, 1.0, 2.0])
        levels_m = np.union1d(parameters.profile[at.PROFILE_LEVEL], knots_m)
        areas_m2 = np.interp(levels_m, parameters.profile[at.PROFILE_LEVEL], parameters.profile[at.PROFILE_AREA])
        areas_m2 *= np.interp(levels_m, knots_m, [self.bottom_factor, self.bottom_factor, 1.0, self.top_factor])
        return replace(parameters, profile=profile_of(list(zip(levels_m, areas_m2, strict=True))))
