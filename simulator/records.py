"""Records: what a dataclass of numbers is to compiled code, in arrays of one record a thing."""

from collections.abc import Sequence
from dataclasses import fields
from functools import cache
from typing import Any, Protocol, TypeVar, cast, overload

import numpy as np
import numpy.typing as npt

NUMBERS = (float, int, bool)

R = TypeVar("R")
R_co = TypeVar("R_co", covariant=True)


class Records(Protocol[R_co]):
    """Array of records; each has the numbers of a dataclass, by the names of their fields.

    By its number a record is a view: what is set in it, is set in the array. By its name a field is an array.
    """

    @property
    def size(self) -> int:
        """Number of records."""

    @overload
    def __getitem__(self, key: int, /) -> R_co: ...
    @overload
    def __getitem__(self, key: str, /) -> npt.NDArray[Any]: ...
    def __setitem__(self, key: str, values: npt.ArrayLike, /) -> None:
        """Set a field of all records."""


def records_of(things: Sequence[R]) -> Records[R]:
    """Records of dataclass instances of one kind: all their fields that are `float`, `int` or `bool`.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> Valve = dataclass(type("Valve", (), {"__annotations__": {"opening": float, "is_stuck": bool}}))
    >>> valves = records_of([Valve(0.5, False), Valve(1.0, True)])
    >>> valves["opening"], bool(valves[1]["is_stuck"])
    (array([0.5, 1. ]), True)
    """
    dtype = _dtype_of(cast("Any", type(things[0])))
    return cast("Records[R]", np.array([_numbers_of(thing, dtype) for thing in things], dtype=dtype))


@cache
def _dtype_of(kind: type[Any]) -> np.dtype[np.void]:
    """The same for each call: compiled code tells types of arrays apart by it, fastest where it is one object."""
    return np.dtype([(field.name, field.type) for field in fields(kind) if field.type in NUMBERS], align=True)


def _numbers_of(thing: object, dtype: np.dtype[np.void]) -> tuple[Any, ...]:
    return tuple(getattr(thing, name) for name in dtype.names or ())
