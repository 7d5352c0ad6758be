"""Compilation of the kernels, with types that mypy can follow."""

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of numbers and arrays; the machine code is kept on disk between runs.

    References are not counted (`_nrt=False`), which took most of the time of a second: such a function may look into
    arrays and change them, but not make any. The plain Python function stays at hand as its attribute `py_func`.
    """
    options: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False}
    return cast("Callable[P, R]", numba.njit(**options)(function))
