"""Sensor with too much noise."""

from typing import Any, ClassVar, Literal

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.table import NonNegative
from wetwell.simulator.faults.profile import ChannelFault
from wetwell.simulator.forcing import Forcing


class SensorNoise(ChannelFault):
    r"""The noise of a sensor grows: a loose contact, foam under the probe, air in the meter.

    $$\sigma(t) = \sigma_0 (1 + (m - 1)\, r(t))$$

    Parameters
    ----------
    factor : float
        m, factor on the standard deviation at full strength; 1 changes nothing. [1]
    channel : "level_m", "inflow_m3h", "flow_m3h", "head_m" or "power_kw"
    pump : int
        Which pump, counted from 1; 0 for all, and for level and inflow.

    References
    ----------
    .. [1] After R. Isermann, Fault-Diagnosis Systems, Springer: faults of sensors.
    """

    neutral: ClassVar[dict[str, Any]] = {"factor": 1.0}

    kind: Literal["sensor_noise"] = "sensor_noise"
    shape: Literal["ramp", "step", "intermittent"] = "step"
    factor: NonNegative = 5.0

    def apply(self, forcing: Forcing, time_s: Floats) -> None:
        """Scale the noise over a block that begins at `time_s[0]`."""
        forcing.sensor_noise_factor[self.rows(forcing)] *= 1.0 + (self.factor - 1.0) * self.share(time_s)
