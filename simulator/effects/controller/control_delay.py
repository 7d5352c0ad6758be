"""A controller that acts late."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters


class ControlDelay(Effect):
    r"""The controller starts and stops pumps by a level that is some seconds old.

    $$L_\text{seen}(t) = L_\text{sensor}(t - d)$$

    Parameters
    ----------
    delay_s : float
        d, how old the level is; 0 is no effect. Levels overshoot by d dL/dt. [s]

    References
    ----------
    .. [1] After K. J. Åström, T. Hägglund, Advanced PID Control, ISA 2006: dead time.
    """

    component: ClassVar[Component] = "controller"
    neutral: ClassVar[dict[str, float]] = {"delay_s": 0.0}

    name: Literal["control_delay"] = "control_delay"
    delay_s: Annotated[float, limits(0.0, 100.0, "s")]

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Hold the level back."""
        return replace(parameters, control_delay_s=self.delay_s)
