"""What a learnt correction is made of: terms of the model, covariates, shapes, and how an addend is computed."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import compiled

Term = Literal[
    "head_loss",
    "static_head",
    "inertia",
    "pump_head",
    "speed",
    "flow_reading",
    "head_reading",
    "power",
    "back_flow",
    "level_balance",
    "level_reading",
    "sump_area",
]
TERMS: tuple[Term, ...] = get_args(Term)
HEAD_LOSS, STATIC_HEAD, INERTIA, PUMP_HEAD, SPEED, FLOW_READING, HEAD_READING = range(7)
POWER_TERM, BACK_FLOW, LEVEL_BALANCE, LEVEL_READING, SUMP_AREA = range(7, 12)
"""Places of the terms: first those of a pipe, then those of a pump, and from the balance on those of the station."""

Covariate = Literal[
    "level_m",
    "flow_m3h",
    "speed_ratio",
    "since_start_s",
    "idle_before_s",
    "hour_of_day",
    "day_of_week",
    "days",
    "pumps_on_main",
    "column",
]
COVARIATES: tuple[Covariate, ...] = get_args(Covariate)
(
    LEVEL_COVARIATE,
    FLOW_COVARIATE,
    SPEED_COVARIATE,
    SINCE_START,
    IDLE_BEFORE,
    HOUR_OF_DAY,
    DAY_OF_WEEK,
    DAYS,
    PUMPS_ON_MAIN,
    COLUMN,
) = range(10)
"""Places of the covariates."""

Shape = Literal["linear", "square", "cosine", "decay", "logarithm", "step"]
SHAPES: tuple[Shape, ...] = get_args(Shape)
LINEAR, SQUARE, COSINE, DECAY, LOGARITHM, STEP, CONSTANT = range(7)
"""Places of the shapes; the last one is that of an offset."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of a user that a correction goes by.

    Attributes
    ----------
    name : str
    noise : float
        Standard deviation of its own errors, which are smoothed away; 0 where it has none. [unit of the column]
    """

    name: str
    noise: float = 0.0


LEAST_LEFT = 0.05
"""Share of a term, or of the inertia that a main has, that a correction has to leave of it. [1]"""
ALL = -1
"""Place of a pump, or a main, that stands for all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectionPart:
    """An addend of a correction, as compiled code reads it.

    Attributes
    ----------
    term, covariate, shape : int
        Places in `TERMS`, `COVARIATES` and `SHAPES`.
    column : int
        Row of the forcing's columns, where the covariate is one of them.
    pump, main : int
        From 0, or `ALL`.
    size : float
        In the unit of the term: a share, or m of the static head, of a head reading and of a level, s²/m² of the
        inertia, m³/h of the balance, and m³/h at 1 m of the back flow.
    centre, scale, low, high : float
        In the unit of the covariate: zero and unit of the shape, and the range in which it is known.
    """

    term: int
    covariate: int = LEVEL_COVARIATE
    shape: int = CONSTANT
    column: int = 0
    pump: int = ALL
    main: int = ALL
    size: float
    centre: float = 0.0
    scale: float = 1.0
    low: float = -math.inf
    high: float = math.inf


@compiled
def shape_at(shape: int, value: float, centre: float, scale: float, low: float, high: float) -> float:
    r"""Dimensionless value of a shape.

    $$z = (x - x_0) / s, \qquad z,\ z^2,\ \cos 2 \pi z,\ e^{-z},\ \ln(1 + z)\ \text{or}\ [z \ge 0]$$

    with x held within the range in which the shape is known, but for the cosine, which is periodic. Where there is
    no value (NaN), x is the centre.
    """
    if shape == CONSTANT:
        return 1.0
    if math.isnan(value):
        value = centre
    if shape == COSINE:
        return math.cos(2.0 * math.pi * (value - centre) / scale)
    ratio = (min(max(value, low), high) - centre) / scale
    if shape == SQUARE:
        ratio *= ratio
    elif shape == DECAY:
        ratio = math.exp(-ratio)
    elif shape == LOGARITHM:
        ratio = math.log(1.0 + max(ratio, 0.0))
    elif shape == STEP:
        ratio = 1.0 if ratio >= 0.0 else 0.0
    return ratio


@compiled
def shapes_at(
    shape: int, values: Floats, centre: float, scale: float, low: float, high: float, found: Floats
) -> None:
    """Set (n,) `found` to the values of a shape."""
    for k in range(values.size):
        found[k] = shape_at(shape, values[k], centre, scale, low, high)
