"""Pumps that share one main."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, MainNumber, limits
from wetwell.simulator.parameters import PlantParameters


class CommonHeader(Effect):
    r"""Pumps that are configured with a main of their own deliver into one main.

    $$H = H_s + \sigma k \Big(\sum_i Q_i\Big)^2 + (1 - \sigma)\, k\, Q_i^2$$

    Of several mains each joins its own pumps. Its presence is its strength; there is no neutral value.

    Parameters
    ----------
    shared_fraction : float
        σ, share of the friction that is in the shared pipe. One pump alone does not notice it. [1]
    main : int
        0 for all.

    References
    ----------
    .. [1] After G. M. Jones et al., Pumping Station Design: parallel pumps on a manifold.
    """

    component: ClassVar[Component] = "rising_main"
    neutral: ClassVar[dict[str, float]] = {}

    name: Literal["common_header"] = "common_header"
    shared_fraction: Annotated[float, limits(0.0, 1.0, "1")] = 1.0
    main: MainNumber = 0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Join the mains."""
        return parameters.with_mains(
            lambda main: replace(main, is_common_header=True, shared_friction=self.shared_fraction), self.main
        )
