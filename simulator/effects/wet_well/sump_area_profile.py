"""Cross-section of the wet well that changes with the level."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

import numpy as np

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters
from wetwell.simulator.wet_well import areas_m2, profile_of_slices

GROWTH_SHARES = np.linspace(0.0, 1.0, 13) ** 2
"""Of the growth of the area up to h, at which the profile has its points."""


class SumpAreaProfile(Effect):
    r"""The wet well is a cone, has benches at its floor, or walls that lean.

    $$A(L) = A_0(L)
    \begin{cases} b + (1 - b) (L / h)^p & L < h \\ 1 + (t - 1) \min(L / h - 1,\ 1) & L \ge h \end{cases}$$

    L counts from the floor. Of a configured profile the area is scaled at its points, and stays linear between them;
    so it does between 13 points of curved walls, within half a per cent of the volume.

    Parameters
    ----------
    bottom_factor : float
        b, area at the floor over the configured one. [1]
    height_m : float
        h, height over the floor at which the area is the configured one. [m]
    exponent : float
        p: 1 for walls that lean evenly, 2 for a cone with a narrow floor, large for a bench with its edge at h. [1]
    top_factor : float
        t, area at 2 h and above over the configured one; with 2 - b the walls lean evenly. [1]

    References
    ----------
    .. [1] After ANSI/HI 9.8, Rotodynamic Pumps for Pump Intake Design: sloped and confined wet wells for solids.
    """

    component: ClassVar[Component] = "sump"
    neutral: ClassVar[dict[str, float]] = {"bottom_factor": 1.0, "top_factor": 1.0}

    name: Literal["sump_area_profile"] = "sump_area_profile"
    bottom_factor: Annotated[float, limits(0.1, 4.0, "1")]
    height_m: Annotated[float, limits(0.1, 10.0, "m")] = 1.0
    exponent: Annotated[float, limits(1.0, 20.0, "1")] = 1.0
    top_factor: Annotated[float, limits(0.1, 4.0, "1")] = 1.0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Scale the area along the profile."""
        if self.bottom_factor == self.top_factor == 1.0:
            return parameters
        grown = GROWTH_SHARES if self.exponent > 1.0 else GROWTH_SHARES[[0, -1]]
        knots_m = self.height_m * np.r_[grown ** (1.0 / self.exponent), 2.0]
        factors = np.r_[self.bottom_factor + (1.0 - self.bottom_factor) * grown, self.top_factor]
        profile = parameters.profile
        knots_m += profile["level_m"][0]
        levels_m = np.union1d(profile["level_m"], knots_m)
        feet_m2, tops_m2 = areas_m2(profile, levels_m)
        factors = np.interp(levels_m, knots_m, factors)
        slices = zip(levels_m, feet_m2 * factors, tops_m2 * np.r_[factors[1:], factors[-1]], strict=True)
        return replace(parameters, profile=profile_of_slices(list(slices)))
