"""A ramp that is not linear."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters


class RampShape(Effect):
    r"""The shaft follows its command by another shape, and late.

    $$\tau \frac{dN}{dt} = \left((1 - b) N_c + \frac{b}{2} (1 - \cos \pi N_c)\right)^p - N, \qquad N_c = f / f_n$$

    The recorded frequency is the command. At nominal speed the shape makes no difference.

    Parameters
    ----------
    power : float
        p, exponent of the ramp: over 1 it starts flat, under 1 steep. [1]
    lag_s : float
        τ, lag of the shaft behind its command; 0 is none. [s]
    bow : float
        b, share of an S-curve in the straight ramp. [1]

    References
    ----------
    .. [1] After B. K. Bose, Modern Power Electronics and AC Drives: ramps and slip of drives in open loop.
    """

    component: ClassVar[Component] = "drive"
    neutral: ClassVar[dict[str, float]] = {"power": 1.0, "lag_s": 0.0, "bow": 0.0}

    name: Literal["ramp_shape"] = "ramp_shape"
    power: Annotated[float, limits(0.2, 5.0, "1")] = 1.0
    lag_s: Annotated[float, limits(0.0, 15.0, "s")] = 0.0
    bow: Annotated[float, limits(0.0, 1.0, "1")] = 0.0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Bend the ramp."""
        return replace(
            parameters,
            ramp_power=parameters.ramp_power * self.power,
            speed_lag_s=parameters.speed_lag_s + self.lag_s,
            ramp_bow=max(parameters.ramp_bow, self.bow),
        )
