"""Compilation of the kernels, with types that mypy can follow; numba is loaded when the first of them is called."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import EnumType
from functools import cache, cached_property, update_wrapper
from hashlib import sha256
from importlib import import_module
from threading import get_ident
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
    made_of : str
        Digest of all that goes into the machine code.
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
        made = _numba().njit(**self._options)(self.py_func)
        if hasattr(made, "overloads"):  # not with NUMBA_DISABLE_JIT
            _stamp(made, self.made_of)
        return made

    @cached_property
    def made_of(self) -> str:
        """Digest of its place and code, of the constants and types in it, and of the kernels that it calls."""
        function, code = cast("Any", self.py_func), cast("Any", self.py_func).__code__
        names = [name for name in code.co_names if name in function.__globals__]
        parts = [
            *(function.__module__, function.__qualname__, code.co_firstlineno, code.co_code, code.co_consts),
            *(code.co_names, code.co_varnames, function.__defaults__, sorted(self._options.items())),
            *(_made_of(function.__globals__[name]) for name in names if function.__globals__[name] is not self),
            *map(_made_of, function.__annotations__.values()),
        ]
        return sha256(repr(parts).encode()).hexdigest()


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of numbers and arrays; the machine code is kept on disk between runs.

    References are not counted (`_nrt=False`): such a function may look into arrays and change them, but not make any.
    Where one compiled function calls another, its code is put in the place of the call (`forceinline`), so that
    the arrays are not handed over number by number. Together this makes a second more than 20 times as quick.
    The plain Python function is its attribute `py_func`.
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


def _made_of(value: Any) -> str:
    """What a global name of a kernel, or the type of an argument, puts into its machine code."""
    if isinstance(value, Kernel):
        return value.made_of
    if isinstance(value, EnumType):
        return repr(list(value))
    fields = getattr(value, "_fields", ()) if isinstance(value, type) else ()
    return repr((value, [(name, _made_of(value.__annotations__[name])) for name in fields]))


def _stamp(dispatcher: Any, made_of: str) -> None:
    """Take machine code on disk for new only if it is made of the same.

    Numba asks for the time of the kernel's own file, whatever became of the kernels that it calls.
    """
    index = dispatcher._cache._cache_file  # noqa: SLF001 - there is no public way
    index._source_stamp = made_of  # noqa: SLF001
    try:
        index._load_index()  # noqa: SLF001
    except (AttributeError, ImportError):  # written for types that have moved since
        index.flush()


@cache
def _numba() -> Any:
    """The compiler, which knows that a kernel stands for its machine code; loading it takes longest of all."""
    with _without("scipy", "yaml", "cffi"):
        numba, extending = import_module("numba"), import_module("numba.extending")
        for later in ("numba.np.arraymath", "numba.core.typing.cffi_utils"):  # the first kernel would load them
            import_module(later)
    extending.typeof_impl.register(Kernel, lambda kernel, _: numba.typeof(kernel.dispatcher))
    return numba


@contextmanager
def _without(*packages: str) -> Iterator[None]:
    """Hide packages from what this thread imports meanwhile.

    Numba looks for them as it loads, a fifth of a command's start-up, and does without where they are missing: for
    products of matrices, a file of settings and functions of C, none of which a kernel here uses.
    """
    finder = _Hidden(frozenset(packages), get_ident())
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        sys.meta_path.remove(finder)


class _Hidden:
    """Says of packages, to one thread, that they are not installed."""

    def __init__(self, packages: frozenset[str], thread: int) -> None:
        self._packages, self._thread = packages, thread

    def find_spec(self, name: str, *_: object) -> None:
        """Raise ModuleNotFoundError for what is hidden; leave all else to Python."""
        if name in self._packages and get_ident() == self._thread:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


_ALLOCATING: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}
_OPTIONS: dict[str, Any] = _ALLOCATING | {"_nrt": False, "forceinline": True}
