"""Sensor with a wrong zero."""

from typing import Any, ClassVar, Literal

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.table import Finite
from wetwell.simulator.faults.profile import ChannelFault
from wetwell.simulator.forcing import Forcing


class SensorBias(ChannelFault):
    r"""A sensor reads too much or too little by a constant.

    $$y(t) = x(t) + b\, r(t)$$

    A pump's sensor shows it while water moves: idle it reads 0.

    Parameters
    ----------
    bias : float
        b, reading less the truth at full strength; negative reads too little. [unit of the channel]
    channel : "level_m", "inflow_m3h", "flow_m3h", "head_m" or "power_kw"
    pump : int
        Which pump, counted from 1; 0 for all, and for level and inflow.

    References
    ----------
    .. [1] After R. Isermann, Fault-Diagnosis Systems, Springer: faults of sensors.
    """

    neutral: ClassVar[dict[str, Any]] = {"bias": 0.0}

    kind: Literal["sensor_bias"] = "sensor_bias"
    shape: Literal["ramp", "step", "intermittent"] = "step"
    bias: Finite

    def apply(self, forcing: Forcing, time_s: Floats) -> None:
        """Add to the bias over a block that begins at `time_s[0]`."""
        forcing.sensor_bias[self.rows(forcing)] += self.bias * self.share(time_s)
