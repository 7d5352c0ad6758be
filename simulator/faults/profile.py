"""How a fault grows, and what becomes of it."""

from typing import Annotated, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from wetwell.protocols.station import NonNegative, Table

Floats = npt.NDArray[np.float64]


class Ramp(Table):
    r"""A fault that grows linearly, then holds or is cleared.

    $$r(t) = 0 \text{ before } t_0,\quad \frac{t - t_0}{t_1 - t_0} \text{ up to } t_1,\quad
    \text{then } 1 \text{ (hold) or } 0 \text{ (clear)}$$

    Parameters
    ----------
    start_s, end_s : float
        t0 and t1, since the start of the scenario. [s]
    after : "hold" or "clear"
        What becomes of the fault after the ramp.
    """

    start_s: NonNegative
    end_s: NonNegative
    after: Literal["hold", "clear"] = "hold"

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if self.end_s <= self.start_s:
            raise ValueError(f"end_s must lie after start_s = {self.start_s:g}, got {self.end_s:g}")
        return self

    def share(self, time_s: Floats) -> Floats:
        """Share r(t) of the full fault, (n,) in 0..1, at (n,) seconds since the start of the scenario."""
        share = np.clip((time_s - self.start_s) / (self.end_s - self.start_s), 0.0, 1.0)
        return np.where(self.is_active(time_s), share, 0.0)

    def is_active(self, time_s: Floats) -> npt.NDArray[np.bool_]:
        """(n,) flags of the seconds in which the fault acts."""
        active: npt.NDArray[np.bool_] = time_s >= self.start_s
        return active if self.after == "hold" else active & (time_s <= self.end_s)


class PumpFault(Ramp):
    """A fault of one pump, counted from 1."""

    pump: Annotated[int, Field(ge=1)]


class SystemFault(Ramp):
    """A fault of the rising main, felt by all pumps."""
