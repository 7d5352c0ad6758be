"""Wear of an impeller."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from wetwell.protocols.arrays import Floats
from wetwell.simulator.faults.profile import PumpFault
from wetwell.simulator.forcing import Forcing


class ImpellerWear(PumpFault):
    r"""Sand and cavitation wear the vanes: less head at every flow.

    $$H(Q, N) = (1 - w\, r(t)) (c_0 N^2 + c_1 N Q + c_2 Q^2)$$

    The operating point slides down the system curve; the run-out flow of the pump stays.

    Parameters
    ----------
    head_loss : float
        w, share of the head that is lost at full strength, 0..1. [1]

    References
    ----------
    .. [1] After J. F. Gülich, Centrifugal Pumps: abrasion of impellers lowers the head.
    """

    neutral: ClassVar[dict[str, Any]] = {"head_loss": 0.0}

    kind: Literal["impeller_wear"] = "impeller_wear"
    head_loss: Annotated[float, Field(ge=0, lt=1)] = 0.15

    def apply(self, forcing: Forcing, time_s: Floats) -> None:
        """Scale the pump's head over a block that begins at `time_s[0]`."""
        forcing.head_factor[self.pump - 1] *= 1.0 - self.head_loss * self.share(time_s)
