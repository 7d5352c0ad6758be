"""How a fault comes and goes, and what it concerns."""

from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from wetwell.protocols.arrays import Flags, Floats
from wetwell.protocols.quantities import STATION_QUANTITIES, SensedQuantity
from wetwell.protocols.station.table import NonNegative, Positive, Table
from wetwell.simulator.forcing import Forcing
from wetwell.simulator.telemetry.channels import channels_of


class Profile(Table):
    r"""Share r(t) of the full fault over time; nothing before the start.

    $$r_\text{ramp} = \min\Bigl(1, \frac{t - t_0}{t_1 - t_0}\Bigr), \qquad r_\text{step} = 1, \qquad
    r_\text{intermittent} = \mathbb{1}[(t - t_0) \bmod T < d\,T]$$

    After $t_1$ it stays as it is (hold; an intermittent fault goes on coming and going) or is 0 (clear).

    Parameters
    ----------
    start_s, end_s : float
        t0 and t1, from when to when it grows, since the start of the scenario. [s]
    after : "hold" or "clear"
        What becomes of the fault after the end.
    shape : "ramp", "step" or "intermittent"
        How the fault comes: it grows from start to end, is there at once, or comes and goes.
    period_s : float
        T, from one coming of an intermittent fault to the next. [s]
    duty : float
        d, share of the period in which an intermittent fault is there. [1]
    """

    neutral: ClassVar[dict[str, Any]]
    """Parameters that are the strength of a fault, with the values at which it changes nothing, bit for bit."""

    start_s: NonNegative
    end_s: NonNegative
    after: Literal["hold", "clear"] = "hold"
    shape: Literal["ramp", "step", "intermittent"] = "ramp"
    period_s: Positive = 3600.0
    duty: Annotated[float, Field(ge=0, le=1)] = 0.5

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if self.end_s <= self.start_s:
            raise ValueError(f"end_s must lie after start_s = {self.start_s:g}, got {self.end_s:g}")
        return self

    def share(self, time_s: Floats) -> Floats:
        """Share r(t) of the full fault, (n,) in 0..1, at (n,) seconds since the start of the scenario."""
        if self.shape != "ramp":
            return self.is_active(time_s).astype(np.float64)
        share = np.clip((time_s - self.start_s) / (self.end_s - self.start_s), 0.0, 1.0)
        return np.where(self.is_active(time_s), share, 0.0)

    def is_active(self, time_s: Floats) -> Flags:
        """(n,) flags of the seconds in which the fault acts."""
        active: Flags = time_s >= self.start_s
        if self.after == "clear":
            active &= time_s <= self.end_s
        if self.shape == "intermittent":
            active &= np.mod(time_s - self.start_s, self.period_s) < self.duty * self.period_s
        return active


class PumpFault(Profile):
    """A fault of one pump.

    Parameters
    ----------
    pump : int
        Which one, counted from 1.
    """

    pump: Annotated[int, Field(ge=1)]


class SystemFault(Profile):
    """A fault of a rising main, felt by all pumps on it.

    Parameters
    ----------
    main : int
        Which one, counted from 1 as in the file; 0 for all.
    """

    main: Annotated[int, Field(ge=0)] = 0

    def of_main(self, values: Floats) -> Floats:
        """(k, n) rows of (mains, n) values that are those of the main."""
        return values[self.main - 1 : self.main] if self.main else values


class SensorFault(Profile):
    """A fault of a sensor, of a channel of the telemetry or of the PLC: the water flows as it should."""


class ChannelFault(SensorFault):
    """A fault of the sensors of one quantity.

    Parameters
    ----------
    channel : str
        Measured value whose sensor it is.
    pump : int
        At which pump, counted from 1; 0 for all, and for level and inflow.
    """

    channel: SensedQuantity
    pump: Annotated[int, Field(ge=0)] = 0

    @model_validator(mode="after")
    def _check_pump(self) -> Self:
        if self.channel in STATION_QUANTITIES and self.pump > 0:
            raise ValueError(f"pump must be 0 for channel '{self.channel}' of the station, got {self.pump}")
        return self

    def rows(self, forcing: Forcing) -> list[int]:
        """Rows of the faulty channels in the sensor arrays of a forcing."""
        return channels_of(self.channel, forcing.speed_factor.shape[0], self.pump or None)
