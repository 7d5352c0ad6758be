"""Leakage through a worn wear ring."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from wetwell.protocols.arrays import Floats
from wetwell.simulator.faults.profile import PumpFault
from wetwell.simulator.forcing import Forcing


class WearRingLeakage(PumpFault):
    r"""Water runs from the discharge back to the suction within the pump: the impeller moves more than comes out.

    $$H(Q, N) = c_0 N^2 + c_1 N (Q + N Q_L r(t)) + c_2 (Q + N Q_L r(t))^2$$

    The pump curve moves to the left by the leakage, which follows the root of the head and so the speed N. The
    operating point slides down the system curve. The meter behind the pump sees Q.

    Parameters
    ----------
    leak_m3h : float
        Q_L, leakage at full strength and nominal speed. [m³/h]

    References
    ----------
    .. [1] After J. F. Gülich, Centrifugal Pumps: leakage through the gap of the impeller's wear ring.
    """

    neutral: ClassVar[dict[str, Any]] = {"leak_m3h": 0.0}

    kind: Literal["wear_ring_leakage"] = "wear_ring_leakage"
    leak_m3h: Annotated[float, Field(ge=0, le=1000)] = 20.0

    def apply(self, forcing: Forcing, time_s: Floats) -> None:
        """Add to the pump's internal leakage over a block that begins at `time_s[0]`."""
        forcing.internal_leak_m3h[self.pump - 1] += self.leak_m3h * self.share(time_s)
