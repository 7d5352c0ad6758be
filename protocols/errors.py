"""Errors that reach a user: one line that names value, rule and place."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pydantic import ValidationError


class WetwellError(Exception):
    """Base of every error that the command line prints as one line, without a traceback."""


class ConfigError(WetwellError):
    """A station file, a scenario or a setting breaks a rule."""


class RecordingError(WetwellError):
    """A recording cannot be read or written."""


class LinkError(WetwellError):
    """A link (Zenoh, Modbus) cannot be opened or used."""


def first_fault(error: "ValidationError", within: str = "") -> str:
    """One line for a failed validation: path of the key, value, rule; further faults are counted.

    An unknown key comes first: it is most often the misspelt one that is missed elsewhere.

    Parameters
    ----------
    error : ValidationError
    within : str
        Key of the file under which what was validated stands; by default it is the whole file.

    Examples
    --------
    >>> from pydantic import BaseModel, Field, ValidationError
    >>> class Sump(BaseModel):
    ...     area_m2: float = Field(gt=0)
    >>> try:
    ...     Sump(area_m2=-8.0)
    ... except ValidationError as error:
    ...     print(first_fault(error))
    area_m2: got -8.0, input should be greater than 0
    """
    faults = error.errors(include_url=False)
    more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
    unknown_keys = [fault for fault in faults if fault["type"] == "extra_forbidden"]
    fault = (unknown_keys or faults)[0]
    return _one_line(fault | {"loc": (within, *fault["loc"])} if within else fault) + more


def _one_line(fault: Mapping[str, Any]) -> str:
    path = _path(fault["loc"])
    message = str(fault["msg"]).removeprefix("Value error, ")
    message = message[:1].lower() + message[1:]
    if fault["type"] == "tuple_type" and isinstance(fault["input"], Mapping):
        message = f"is one table, must be a list of tables: write [[{_header(fault['loc'])}]]"
    if fault["type"] == "extra_forbidden":
        return f"{path}: unknown key"
    if fault["type"] == "missing":
        return f"{path}: missing"
    if fault["type"] == "json_invalid":
        return message
    if isinstance(fault["input"], Mapping) or fault["type"] == "value_error":
        return f"{path}: {message}" if path else message
    if path.endswith(("password", "secret", "token")):
        return f"{path}: {message}"
    return f"{path}: got {fault['input']!r}, {message}"


def _header(location: Sequence[int | str]) -> str:
    """What stands in brackets over a table; behind a number pydantic has the kind of a union, which does not."""
    names = [part for before, part in zip((None, *location), location, strict=False) if not isinstance(before, int)]
    return ".".join(part for part in names if isinstance(part, str))


def _path(location: Sequence[int | str]) -> str:
    path = ""
    for part in location:
        if isinstance(part, int):
            path += f"[{part + 1}]"
        else:
            name = part if part.isprintable() else repr(part)
            path += f".{name}" if path else name
    return path
