"""Sensor that is stuck."""

from typing import Any, ClassVar, Literal

from wetwell.protocols.arrays import Floats
from wetwell.simulator.faults.profile import ChannelFault
from wetwell.simulator.forcing import Forcing


class SensorStuck(ChannelFault):
    r"""A sensor repeats its last reading, without noise; the controller acts on a stuck level as on a true one.

    $$y(t) = y(t_0 - 1\,\text{s}) \text{ while } r(t) = 1$$

    Parameters
    ----------
    channel : "level_m", "inflow_m3h", "flow_m3h", "head_m" or "power_kw"
    pump : int
        Which pump, counted from 1; 0 for all, and for level and inflow.
    shape : "step" or "intermittent"

    References
    ----------
    .. [1] After R. Isermann, Fault-Diagnosis Systems, Springer: faults of sensors.
    """

    neutral: ClassVar[dict[str, Any]] = {"shape": "intermittent", "duty": 0.0}

    kind: Literal["sensor_stuck"] = "sensor_stuck"
    shape: Literal["step", "intermittent"] = "step"

    def apply(self, forcing: Forcing, time_s: Floats) -> None:
        """Hold the readings in a block that begins at `time_s[0]`."""
        forcing.is_sensor_stuck[self.rows(forcing)] |= self.is_active(time_s)
