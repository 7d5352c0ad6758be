"""PLC whose program stands still."""

from typing import Any, ClassVar, Literal

from wetwell.protocols.arrays import Floats
from wetwell.simulator.faults.profile import SensorFault
from wetwell.simulator.forcing import Forcing


class FrozenPlc(SensorFault):
    r"""The program of the PLC stops: outputs stay as they are, and all telemetry repeats its last value.

    $$y(t) = y(t_0 - 1\,\text{s}), \quad u(t) = u(t_0 - 1\,\text{s}) \text{ while } r(t) = 1$$

    Pumps go on as they were while the level runs away.

    Parameters
    ----------
    shape : "step" or "intermittent"

    References
    ----------
    .. [1] After IEC 61131-2, Industrial-process measurement and control, Programmable controllers: outputs that
       hold their last state.
    """

    neutral: ClassVar[dict[str, Any]] = {"shape": "intermittent", "duty": 0.0}

    kind: Literal["frozen_plc"] = "frozen_plc"
    shape: Literal["step", "intermittent"] = "step"

    def apply(self, forcing: Forcing, time_s: Floats) -> None:
        """Stop the PLC's program in a block that begins at `time_s[0]`."""
        forcing.is_plc_frozen[:] |= self.is_active(time_s)
