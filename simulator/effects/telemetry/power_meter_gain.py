"""Power meters that read too much or too little."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters


class PowerMeterGain(Effect):
    r"""Every pump's power reads a constant factor off: another ratio of the current transformers, or a wrong phase.

    $$y = g\, P$$

    An efficiency that is otherwise than in the station file reads alike.

    Parameters
    ----------
    factor : float
        g, reading over the true power; 1 is no effect. [1]

    References
    ----------
    .. [1] After IEC 61869-2, Additional requirements for current transformers: ratio error.
    """

    component: ClassVar[Component] = "power_meter"
    has_one_form: ClassVar[bool] = True
    neutral: ClassVar[dict[str, float]] = {"factor": 1.0}
    may_change: ClassVar[bool] = True

    name: Literal["power_meter_gain"] = "power_meter_gain"
    factor: Annotated[float, limits(0.3, 3.0, "1")]

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Scale the readings."""
        return parameters.with_sensors(lambda sensor: replace(sensor, gain=sensor.gain * self.factor), "power_kw")
