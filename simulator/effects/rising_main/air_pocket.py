"""Air at a high point of the main."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, MainNumber, limits
from wetwell.simulator.parameters import PlantParameters


class AirPocket(Effect):
    r"""Air gathers while the station idles, lifts the static head, and is purged while water flows.

    $$\frac{da}{dt} = \frac{a_{\max} - a}{\tau_g} \text{ idle}, \qquad
    \frac{da}{dt} = -\frac{a}{\tau_p} \text{ running}, \qquad H = H_s + a + k Q^2$$

    At the beginning, after a long idle, all air is there.

    Parameters
    ----------
    head_m : float
        a_max, head that the whole pocket costs; 0 is no effect. [m]
    growth_s : float
        τ_g, time in which air gathers while the pumps stand: 63 % of the pocket. [s]
    purge_s : float
        τ_p, time in which running water carries 63 % of the pocket away. [s]
    pocket : str
        "own": mains of their own have a pocket each; "shared": they meet at the high point, and whichever runs purges
        it for all. One main has one pocket.
    main : int
        0 for all.

    References
    ----------
    .. [1] After M. Escarameia, Investigating hydraulic removal of air from water pipelines, Water Management 2007.
    """

    component: ClassVar[Component] = "rising_main"
    neutral: ClassVar[dict[str, float]] = {"head_m": 0.0}
    another_at: ClassVar[dict[str, Literal["low", "high"]]] = {"purge_s": "high"}

    name: Literal["air_pocket"] = "air_pocket"
    head_m: Annotated[float, limits(0.0, 20.0, "m")]
    growth_s: Annotated[float, limits(10.0, 1.0e5, "s")] = 1800.0
    purge_s: Annotated[float, limits(5.0, 1.0e4, "s")] = 120.0
    pocket: Literal["own", "shared"] = "own"
    main: MainNumber = 0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Let air gather."""
        return parameters.with_mains(
            lambda main: replace(
                main,
                air_head_m=self.head_m,
                air_growth_s=self.growth_s,
                air_purge_s=self.purge_s,
                is_air_shared=self.pocket == "shared",
            ),
            self.main,
        )
