"""Rags that gather in a run."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, PumpNumber, limits
from wetwell.simulator.parameters import PlantParameters


class Ragging(Effect):
    r"""Rags come with the water, to a limit: on the impeller they cost speed, before it head; the stop sheds them.

    $$\frac{d\rho}{dt} = \frac{1 - \rho}{\tau}\,\frac{Q}{Q_r}, \qquad \rho = 0 \text{ after a stop}, \qquad
    N = N_c (1 - \rho\,n), \qquad H = H(Q, N) - \rho\,h\,(Q / Q_r)^2$$

    with the rated flow Q_r.

    Parameters
    ----------
    speed_loss : float
        n, share of the speed that all rags together cost; 0 is none. [1]
    throttle_m : float
        h, head that all rags together cost at the rated flow; 0 is none. [m]
    growth_s : float
        τ, running time at the rated flow in which 63 % of the rags have gathered. [s]
    pump : int
        0 for all.

    References
    ----------
    .. [1] After Eshkofti et al., Modeling and physics-enhanced fault detection in wastewater pump stations:
       a blockage as a loss of effective speed.
    .. [2] I. E. Idelchik, Handbook of Hydraulic Resistance: a narrowed inlet loses head with the square of the flow.
    """

    component: ClassVar[Component] = "pump"
    neutral: ClassVar[dict[str, float]] = {"speed_loss": 0.0, "throttle_m": 0.0}
    another_at: ClassVar[dict[str, Literal["low", "high"]]] = {"growth_s": "low"}
    may_change: ClassVar[bool] = True

    name: Literal["ragging"] = "ragging"
    speed_loss: Annotated[float, limits(0.0, 0.5, "1")] = 0.0
    throttle_m: Annotated[float, limits(0.0, 20.0, "m")] = 0.0
    growth_s: Annotated[float, limits(5.0, 1.0e5, "s")] = 600.0
    pump: PumpNumber = 0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Let rags gather."""
        return parameters.with_pumps(
            lambda pump: replace(
                pump,
                ragging_speed_loss=self.speed_loss,
                ragging_h2_m5=self.throttle_m / pump.rated_flow_m3h**2,
                ragging_s=self.growth_s,
            ),
            self.pump,
        )
