"""Compilation of the kernels, with types that mypy can follow; numba is loaded when the first of them is called."""

from collections.abc import Callable
from functools import cache, cached_property, update_wrapper
from importlib import import_module
from typing import Any, Generic, ParamSpec, TypeVar, cast

P = ParamSpec("P")
R = TypeVar("R")


class Kernel(Generic[P, R]):
    """A function that is compiled when it is first called: what only looks at a station does without the compiler.

    Attributes
    ----------
    py_func : callable
        The plain Python function.
    dispatcher : numba's dispatcher
        Finds the machine code for the types of arguments, and compiles what there is none of.
    """

    def __init__(self, py_func: Callable[P, R], options: dict[str, Any]) -> None:
        self.py_func = py_func
        self._options = options
        update_wrapper(self, py_func)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Call the machine code."""
        result: R = self.dispatcher(*args, **kwargs)
        return result

    def __reduce__(self) -> str:
        """By name, as a function: each process compiles for itself, or loads what is on disk."""
        return self.py_func.__qualname__

    @cached_property
    def dispatcher(self) -> Any:
        """Numba's, made at the first use."""
        return _numba().njit(**self._options)(self.py_func)


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of numbers and arrays; the machine code is kept on disk between runs.

    References are not counted (`_nrt=False`): such a function may look into arrays and change them, but not make any.
    Where one compiled function calls another, its code is put in the place of the call (`forceinline`), so that
    the arrays are not handed over number by number. Together this makes a second more than 20 times as quick.
    Numba takes the code on disk for new while the file of the function that is called from Python is unchanged:
    after a change in a function that it calls, touch it. The plain Python function is its attribute `py_func`.
    """
    return Kernel(function, _OPTIONS)


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function as `compiled` does, but without an entry from Python: only compiled code can call it.

    What unpacks the arguments takes longest to compile where they are tuples of arrays.
    """
    return Kernel(function, _OPTIONS | {"no_cpython_wrapper": True})


def allocating(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function that makes arrays of its own: references are counted, and no code is put in its place."""
    return Kernel(function, _ALLOCATING)


def plain(function: Callable[P, R]) -> Callable[P, R]:
    """The Python function of a kernel that calls no other: for a few numbers, without the compiler."""
    return cast("Callable[P, R]", cast("Any", function).py_func)


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
    dispatcher = cast("Any", getattr(function, "dispatcher", function))
    if not hasattr(dispatcher, "overloads"):  # NUMBA_DISABLE_JIT, or a plain function
        return function
    signature = tuple(map(_numba().typeof, args))
    if signature not in dispatcher.overloads:
        dispatcher.compile(signature)
    return cast("Callable[P, R]", dispatcher.overloads[signature].entry_point)


@cache
def _numba() -> Any:
    """The compiler, which knows that a kernel stands for its machine code; loading it takes longest of all."""
    numba, extending = import_module("numba"), import_module("numba.extending")
    extending.typeof_impl.register(Kernel, lambda kernel, _: numba.typeof(kernel.dispatcher))
    return numba


_ALLOCATING: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}
_OPTIONS: dict[str, Any] = _ALLOCATING | {"_nrt": False, "forceinline": True}
