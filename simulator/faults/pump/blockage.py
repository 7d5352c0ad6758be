"""Internal blockage of a pump."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from wetwell.protocols.arrays import Floats
from wetwell.simulator.faults.profile import PumpFault
from wetwell.simulator.forcing import Forcing


class Blockage(PumpFault):
    r"""Debris in the volute: the water sees less speed than the drive commands.

    $$\omega_\text{effective} = (1 - \beta\, r(t))\, \omega_\text{commanded}$$

    The pump curve follows by the affinity laws; frequency and motor current stay as commanded, so that the operating
    point slides down the system curve.

    Parameters
    ----------
    speed_loss : float
        β, share of the speed that is lost at full strength, 0..1. [1]

    References
    ----------
    .. [1] Eshkofti et al., Modeling and physics-enhanced fault detection in wastewater pump stations:
       pump internal blockage scenario (β = 0.4).
    """

    neutral: ClassVar[dict[str, Any]] = {"speed_loss": 0.0}

    kind: Literal["blockage"] = "blockage"
    speed_loss: Annotated[float, Field(ge=0, lt=1)] = 0.4

    def apply(self, forcing: Forcing, time_s: Floats) -> None:
        """Multiply the pump's speed factor over a block that begins at `time_s[0]`."""
        forcing.speed_factor[self.pump - 1] *= 1.0 - self.speed_loss * self.share(time_s)
