"""A worn pump."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, PumpNumber, limits
from wetwell.simulator.parameters import PlantParameters


class PumpWear(Effect):
    r"""The curve of a worn pump is lower: its impeller gives less head, and water runs back through its wear rings.

    $$H(Q, N) = (1 - w) \left(c_0 N^2 + c_1 N (Q + q N) + c_2 (Q + q N)^2\right) - v \frac{Q^2}{Q_r^2}$$

    Rough or blunt vanes lose head with the square of the flow.

    Parameters
    ----------
    head_loss : float
        w, share of the head that the impeller has lost; 0 is none. [1]
    leak_m3h : float
        q, leakage at nominal speed; 0 is none. [m³/h]
    vane_loss_m : float
        v, head that the vanes lose at the rated flow; 0 is none. [m]
    pump : int
        0 for all.

    References
    ----------
    .. [1] After J. F. Gülich, Centrifugal Pumps, Springer: leakage losses at annular seals, effect of wear.
    """

    component: ClassVar[Component] = "pump"
    neutral: ClassVar[dict[str, float]] = {"head_loss": 0.0, "leak_m3h": 0.0, "vane_loss_m": 0.0}
    may_change: ClassVar[bool] = True
    reach: ClassVar[dict[str, tuple[float, float]]] = {"leak_m3h": (60.0, 0.3)}

    name: Literal["pump_wear"] = "pump_wear"
    head_loss: Annotated[float, limits(0.0, 0.6, "1")] = 0.0
    leak_m3h: Annotated[float, limits(0.0, 1500.0, "m³/h")] = 0.0
    vane_loss_m: Annotated[float, limits(0.0, 20.0, "m")] = 0.0
    pump: PumpNumber = 0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Lower the curve and move it to the left."""
        kept, q = 1.0 - self.head_loss, self.leak_m3h
        return parameters.with_pumps(
            lambda pump: replace(
                pump,
                c0=kept * (pump.c0 + (pump.c1 + pump.c2 * q) * q),
                c1=kept * (pump.c1 + 2.0 * pump.c2 * q),
                c2=kept * pump.c2 - self.vane_loss_m / pump.rated_flow_m3h**2,
            ),
            self.pump,
        )
