"""An addend of a learnt correction, as a station file has it."""

from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from wetwell.protocols.recordings.covariates import COVARIATE_PATTERN
from wetwell.protocols.station.table import Finite, Positive, Table
from wetwell.simulator.corrections.parts import SHAPES, Column, Covariate, Shape, shape_at

MOST_SIZE = 4.0
"""Size of an addend at the most, as a share of the term's reference. [1]"""

Size = Annotated[float, Field(ge=-MOST_SIZE, le=MOST_SIZE, allow_inf_nan=False)]


class PartTable(Table):
    """One addend: data of a fixed form, nothing that is evaluated.

    Parameters
    ----------
    covariate : str
        What it goes by; "column" is a column of a user.
    column : str, optional
        Name of that column, without its prefix.
    noise : float
        Standard deviation of the column's own errors, which have no memory; it is smoothed by that. 0 takes it as it
        is. [unit of the column]
    shape : str
        How it goes by that.
    size : float
        Share of the term's reference. [1]
    centre, scale : float
        Zero and unit of the shape, in the unit of the covariate; of a cosine where it is highest, and its period.
    low, high : float
        Range in which the shape is known; beyond it, it stays as it is at its end. A cosine needs none.
    """

    covariate: Covariate
    column: Annotated[str, Field(pattern=COVARIATE_PATTERN, examples=["rain_mm_h"])] | None = None
    noise: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] = 0.0
    shape: Shape
    size: Size
    centre: Finite = 0.0
    scale: Positive = 1.0
    low: Annotated[Finite | None, Field(examples=[0.0])] = None
    high: Annotated[Finite | None, Field(examples=[20.0])] = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.column is None) == (self.covariate == "column"):
            raise ValueError(f"column: is for covariate 'column', and needed there; got covariate '{self.covariate}'")
        if self.noise and self.column is None:
            raise ValueError(
                f"noise: got {self.noise:g}, only a column has errors; the covariate is '{self.covariate}'"
            )
        if self.shape != "cosine":
            if self.low is None or self.high is None:
                raise ValueError(f"low, high: missing; shape '{self.shape}' needs the range in which it is known")
            if self.low >= self.high:
                raise ValueError(f"high: got {self.high:g}, must lie over low = {self.low:g}")
            if self.shape == "decay" and self.low < self.centre:
                raise ValueError(f"low: got {self.low:g}, of shape 'decay' it must not lie under {self.centre:g}")
        return self

    @property
    def source(self) -> Column | None:
        """The column that it goes by; None where it goes by something of the model."""
        return None if self.column is None else Column(name=self.column, noise=self.noise)

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value of the addend, as shares of the term's reference."""
        if self.shape == "cosine":
            return -abs(self.size), abs(self.size)
        low, high = self.known
        values = {low, high, min(max(self.centre, low), high)}
        shape = SHAPES.index(self.shape)
        sizes = [self.size * shape_at(shape, value, self.centre, self.scale, low, high) for value in values]
        return min(sizes), max(sizes)

    @property
    def known(self) -> tuple[float, float]:
        """Range in which the shape is known."""
        return (-np.inf if self.low is None else self.low), (np.inf if self.high is None else self.high)
