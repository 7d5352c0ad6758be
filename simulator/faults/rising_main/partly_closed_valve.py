"""Valve in the rising main that is not fully open."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.table import Fraction
from wetwell.simulator.faults.profile import SystemFault
from wetwell.simulator.forcing import Forcing


class PartlyClosedValve(SystemFault):
    r"""A gate valve left partly closed throttles all pumps: its loss grows as the square of the velocity in the gap.

    $$k(t) = k_0 \Bigl(1 + s \Bigl(\frac{1}{x(t)^2} - 1\Bigr)\Bigr), \qquad x(t) = 1 - (1 - x_1)\, r(t)$$

    The operating point climbs along the pump curve.

    Parameters
    ----------
    main : int
        Which main, counted from 1; 0 for all.
    opening : float
        x1, open share of the valve's area at full strength, 0.01..1. [1]
    valve_share : float
        s, share of the open valve in the friction of the main. [1]

    References
    ----------
    .. [1] After I. E. Idelchik, Handbook of Hydraulic Resistance: gate valves.
    """

    neutral: ClassVar[dict[str, Any]] = {"opening": 1.0}

    kind: Literal["partly_closed_valve"] = "partly_closed_valve"
    opening: Annotated[float, Field(ge=0.01, le=1)] = 0.25
    valve_share: Fraction = 0.05

    def apply(self, forcing: Forcing, time_s: Floats) -> None:
        """Raise the friction over a block that begins at `time_s[0]`."""
        opening = 1.0 - (1.0 - self.opening) * self.share(time_s)
        self.of_main(forcing.friction_factor)[:] *= 1.0 + self.valve_share * (1.0 / opening**2 - 1.0)
