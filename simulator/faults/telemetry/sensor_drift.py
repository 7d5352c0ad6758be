"""Sensor that drifts."""

from typing import Any, ClassVar, Literal

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.table import Finite
from wetwell.simulator.faults.profile import ChannelFault
from wetwell.simulator.forcing import Forcing
from wetwell.simulator.wet_well import SECONDS_PER_HOUR


class SensorDrift(ChannelFault):
    r"""The zero of a sensor wanders at a steady rate, from the start of the fault to its end.

    $$y(t) = x(t) + d\, \frac{t_1 - t_0}{3600\,\text{s}}\, r(t)$$

    Clear is a sensor that is calibrated anew. A pump's sensor shows it while water moves: idle it reads 0.

    Parameters
    ----------
    bias_per_hour : float
        d, how fast the reading leaves the truth; negative falls. [unit of the channel an hour]
    channel : "level_m", "inflow_m3h", "flow_m3h", "head_m" or "power_kw"
    pump : int
        Which pump, counted from 1; 0 for all, and for level and inflow.

    References
    ----------
    .. [1] After R. Isermann, Fault-Diagnosis Systems, Springer: faults of sensors.
    """

    neutral: ClassVar[dict[str, Any]] = {"bias_per_hour": 0.0}

    kind: Literal["sensor_drift"] = "sensor_drift"
    shape: Literal["ramp"] = "ramp"
    bias_per_hour: Finite

    def apply(self, forcing: Forcing, time_s: Floats) -> None:
        """Add to the bias over a block that begins at `time_s[0]`."""
        full_bias = self.bias_per_hour * (self.end_s - self.start_s) / SECONDS_PER_HOUR
        forcing.sensor_bias[self.rows(forcing)] += full_bias * self.share(time_s)
