"""Rags that gather in a run."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, PumpNumber, limits
from wetwell.simulator.parameters import PlantParameters


class Ragging(Effect):
    r"""Rags gather on the impeller in a run, as a loss of speed that grows to a limit; the stop sheds them.

    $$N = N_c (1 - \rho), \qquad \frac{d\rho}{dt} = \frac{\rho_{\max} - \rho}{\tau} \text{ in a run}, \qquad
    \rho = 0 \text{ after a stop}$$

    Parameters
    ----------
    speed_loss : float
        ρ_max, share of the speed that all rags together cost; 0 is no effect. [1]
    growth_s : float
        τ, running time in which 63 % of the rags have gathered. [s]
    pump : int
        0 for all.

    References
    ----------
    .. [1] After Eshkofti et al., Modeling and physics-enhanced fault detection in wastewater pump stations:
       a blockage as a loss of effective speed.
    """

    component: ClassVar[Component] = "pump"
    neutral: ClassVar[dict[str, float]] = {"speed_loss": 0.0}
    may_change: ClassVar[bool] = True

    name: Literal["ragging"] = "ragging"
    speed_loss: Annotated[float, limits(0.0, 0.5, "1")]
    growth_s: Annotated[float, limits(30.0, 1.0e5, "s")] = 600.0
    pump: PumpNumber = 0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Let rags gather."""
        return parameters.with_pumps(
            lambda pump: replace(pump, ragging_limit=self.speed_loss, ragging_s=self.growth_s), self.pump
        )
