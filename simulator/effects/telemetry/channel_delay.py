"""A channel that is late."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters


class ChannelDelay(Effect):
    r"""The recording gets one channel late; the controller, which is wired, does not.

    $$y(t) = x(t - d)$$

    Parameters
    ----------
    channel : str
        Measured value that is late, of every pump if it is one of the pumps.
    delay_s : float
        d, how late the recording gets it; 0 is no effect. [s]

    References
    ----------
    .. [1] After IEEE 1815, Electric Power Systems Communications, DNP3: polled data without time of their own.
    """

    component: ClassVar[Component] = "telemetry"
    neutral: ClassVar[dict[str, float]] = {"delay_s": 0.0}

    name: Literal["channel_delay"] = "channel_delay"
    channel: AnalogueQuantity
    delay_s: Annotated[float, limits(0.0, 100.0, "s")]

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Delay the channel."""
        return parameters.with_sensors(lambda sensor: replace(sensor, delay_s=self.delay_s), self.channel)
