"""Rags that come and go on an impeller."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.table import Positive
from wetwell.simulator.faults.profile import PumpFault
from wetwell.simulator.forcing import Forcing


class Ragging(PumpFault):
    r"""Fibres catch on the impeller and come off again: speed is lost now and then.

    $$\omega_\text{effective} = (1 - \rho\, r(t))\, \omega_\text{commanded}$$

    As a blockage, but intermittent unless another shape is asked for. Rags that gather in each run and fall off at
    its end are the effect of the same name.

    Parameters
    ----------
    speed_loss : float
        ρ, share of the speed that is lost at full strength, 0..1. [1]
    shape : "intermittent", "ramp" or "step"
    period_s, duty : float
        From one catch to the next; share of that time until the rags come off. [s, 1]

    References
    ----------
    .. [1] After Eshkofti et al., Modeling and physics-enhanced fault detection in wastewater pump stations:
       a blockage as a loss of effective speed.
    """

    neutral: ClassVar[dict[str, Any]] = {"speed_loss": 0.0}

    kind: Literal["ragging"] = "ragging"
    shape: Literal["ramp", "step", "intermittent"] = "intermittent"
    period_s: Positive = 7200.0
    speed_loss: Annotated[float, Field(ge=0, lt=1)] = 0.2

    def apply(self, forcing: Forcing, time_s: Floats) -> None:
        """Multiply the pump's speed factor over a block that begins at `time_s[0]`."""
        forcing.speed_factor[self.pump - 1] *= 1.0 - self.speed_loss * self.share(time_s)
