"""A channel that is reported when it has moved."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters


class ReportByException(Effect):
    r"""The recording holds a channel's last value until the channel has moved by a deadband.

    $$y_t = \begin{cases} y_{t-1} & |x_t - y_{t-1}| < b \\ x_t & |x_t - y_{t-1}| \ge b \end{cases}$$

    Parameters
    ----------
    channel : str
        Measured value that is reported so, of every pump if it is one of the pumps.
    deadband : float
        b, change that is needed before a new value comes; 0 is no effect. [unit of the channel]

    References
    ----------
    .. [1] After IEEE 1815, Electric Power Systems Communications, DNP3: analogue events with a deadband.
    """

    component: ClassVar[Component] = "telemetry"
    neutral: ClassVar[dict[str, float]] = {"deadband": 0.0}

    name: Literal["report_by_exception"] = "report_by_exception"
    channel: AnalogueQuantity
    deadband: Annotated[float, limits(0.0, 1000.0, "unit of the channel")]

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Hold the channel."""
        return parameters.with_sensors(lambda sensor: replace(sensor, deadband=self.deadband), self.channel)
