"""Compilation of the kernels, with types that mypy can follow."""

from collections.abc import Callable
from typing import Any, Generic, ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of numbers and arrays; the machine code is kept on disk between runs.

    References are not counted (`_nrt=False`): such a function may look into arrays and change them, but not make any.
    Where one compiled function calls another, its code is put in the place of the call (`forceinline`), so that
    the arrays are not handed over number by number. Together this makes a second more than 20 times as quick.
    Numba takes the code on disk for new while the file of the function that is called from Python is unchanged:
    after a change in a function that it calls, touch it. The plain Python function is its attribute `py_func`.
    """
    return cast("Callable[P, R]", numba.njit(**_OPTIONS)(function))


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function as `compiled` does, but without an entry from Python: only compiled code can call it.

    What unpacks the arguments takes longest to compile where they are tuples of arrays.
    """
    return cast("Callable[P, R]", numba.njit(**_OPTIONS | {"no_cpython_wrapper": True})(function))


class SameTypes(Generic[P, R]):
    """A compiled function that is called with positional arguments of the same types each time.

    Only the first call has a look at them, which takes longer than a sample or a second of a plant. Later arrays of
    another type, or not in one piece where the first was, are misread: whoever calls makes sure of it.
    """

    def __init__(self, function: Callable[P, R]) -> None:
        self._function = function
        self._code: Callable[P, R] | None = None

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Call the function."""
        if self._code is None:
            self._code = _code_for(self._function, args)
        return self._code(*args, **kwargs)


def _code_for(function: Callable[P, R], args: tuple[Any, ...]) -> Callable[P, R]:
    """Machine code of a compiled function for arguments of these types."""
    dispatcher = cast("Any", function)
    if not hasattr(dispatcher, "overloads"):  # NUMBA_DISABLE_JIT
        return function
    signature = tuple(map(numba.typeof, args))
    if signature not in dispatcher.overloads:
        dispatcher.compile(signature)
    return cast("Callable[P, R]", dispatcher.overloads[signature].entry_point)


_OPTIONS: dict[str, Any] = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "_nrt": False,
    "forceinline": True,
}
