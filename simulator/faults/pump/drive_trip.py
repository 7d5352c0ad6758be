"""Drive that trips."""

from typing import Any, ClassVar, Literal

from wetwell.protocols.arrays import Floats
from wetwell.simulator.faults.profile import PumpFault
from wetwell.simulator.forcing import Forcing


class DriveTrip(PumpFault):
    r"""Thermal or earth-fault protection switches the drive off at once, without a ramp.

    $$f(t) = 0 \text{ while } r(t) = 1$$

    The controller knows it, passes the pump over and starts another by level; once the drive is reset, the pump takes
    its turn again.

    Parameters
    ----------
    shape : "step" or "intermittent"
        Intermittent is a drive that trips and is reset again and again.

    References
    ----------
    .. [1] After IEC 60204-1, Safety of machinery, Electrical equipment of machines: protection of motors against
       overheating.
    """

    neutral: ClassVar[dict[str, Any]] = {"shape": "intermittent", "duty": 0.0}

    kind: Literal["drive_trip"] = "drive_trip"
    shape: Literal["step", "intermittent"] = "step"

    def apply(self, forcing: Forcing, time_s: Floats) -> None:
        """Trip the pump's drive in a block that begins at `time_s[0]`."""
        forcing.is_tripped[self.pump - 1] |= self.is_active(time_s)
