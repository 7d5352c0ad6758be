"""Head sensors that are off."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters


class HeadSensorOffset(Effect):
    r"""Every pump's head sensor is off by a constant while its pump runs; it reads 0 while the pump stands.

    $$y = H + o$$

    Parameters
    ----------
    offset_m : float
        o, reading less the true head; 0 is no effect. [m]

    References
    ----------
    .. [1] After J. P. Bentley, Principles of Measurement Systems: zero error of pressure sensors.
    """

    component: ClassVar[Component] = "head_sensor"
    has_one_form: ClassVar[bool] = True
    neutral: ClassVar[dict[str, float]] = {"offset_m": 0.0}
    may_change: ClassVar[bool] = True

    name: Literal["head_sensor_offset"] = "head_sensor_offset"
    offset_m: Annotated[float, limits(-20.0, 20.0, "m")]

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Shift the readings."""
        return parameters.with_sensors(lambda sensor: replace(sensor, offset=sensor.offset + self.offset_m), "head_m")
