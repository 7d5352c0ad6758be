"""A ramp that is not linear."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.parameters import PlantParameters


class RampShape(Effect):
    r"""The shaft follows its command by another shape, and late.

    $$\tau \frac{dN}{dt} = \left((1 - b) N_1 + \frac{b}{2} (1 - \cos \pi N_1)\right)^p - N, \qquad
    N_1 = \begin{cases} N_c\, n / x & N_c < x \\ 1 - (1 - N_c) (1 - n) / (1 - x) & N_c \ge x \end{cases}$$

    with the command $N_c = f / f_n$, which is what is recorded, and $n = x + a (1 - x)$. At nominal speed the shape
    makes no difference. Drives for pumps may have two slopes: a steep first one spares the bearings low speed.

    Parameters
    ----------
    power : float
        p, exponent of the ramp: over 1 it starts flat, under 1 steep. [1]
    lag_s : float
        τ, lag of the shaft behind its command; 0 is none. [s]
    bow : float
        b, share of an S-curve in the straight ramp. [1]
    ahead : float
        a, share of what is left at the knee that the first of two slopes does as well; 0 is a straight ramp. [1]
    knee : float
        x, share of the command at which the first slope ends. [1]

    References
    ----------
    .. [1] After B. K. Bose, Modern Power Electronics and AC Drives: ramps and slip of drives in open loop.
    .. [2] Phase Technologies, SD Series manual, 6.6: submersible pumps, to 30 Hz in a second, to full speed in ten.
    """

    component: ClassVar[Component] = "drive"
    neutral: ClassVar[dict[str, float]] = {"power": 1.0, "lag_s": 0.0, "bow": 0.0, "ahead": 0.0}

    name: Literal["ramp_shape"] = "ramp_shape"
    power: Annotated[float, limits(0.2, 5.0, "1")] = 1.0
    lag_s: Annotated[float, limits(0.0, 15.0, "s")] = 0.0
    bow: Annotated[float, limits(0.0, 1.0, "1")] = 0.0
    ahead: Annotated[float, limits(0.0, 1.0, "1")] = 0.0
    knee: Annotated[float, limits(0.05, 0.9, "1")] = 0.25

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Bend the ramp."""
        return replace(
            parameters,
            ramp_power=parameters.ramp_power * self.power,
            speed_lag_s=parameters.speed_lag_s + self.lag_s,
            ramp_bow=max(parameters.ramp_bow, self.bow),
            ramp_ahead=max(parameters.ramp_ahead, self.ahead),
            ramp_knee=self.knee if self.ahead > parameters.ramp_ahead else parameters.ramp_knee,
        )
