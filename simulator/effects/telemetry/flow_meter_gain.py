"""Flow meters that read too much or too little."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters


class FlowMeterGain(Effect):
    r"""Every pump's flow meter reads a constant factor off; the inflow meter does not.

    $$y = g\, Q$$

    Parameters
    ----------
    factor : float
        g, reading over the true flow; 1 is no effect. [1]

    References
    ----------
    .. [1] After R. C. Baker, Flow Measurement Handbook, Cambridge University Press: calibration.
    """

    component: ClassVar[Component] = "flow_meter"
    has_one_form: ClassVar[bool] = True
    neutral: ClassVar[dict[str, float]] = {"factor": 1.0}
    may_change: ClassVar[bool] = True

    name: Literal["flow_meter_gain"] = "flow_meter_gain"
    factor: Annotated[float, limits(0.3, 3.0, "1")]

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Scale the readings."""
        return parameters.with_sensors(lambda sensor: replace(sensor, gain=sensor.gain * self.factor), "flow_m3h")
