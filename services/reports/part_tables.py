"""Lists of the parts that files may name: kinds, parameters with defaults and ranges, and what each is."""

from collections.abc import Mapping, Sequence
from inspect import cleandoc
from textwrap import fill
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from wetwell.services.reports.text_table import SCREEN_WIDTH

_LIMITS = {"ge": ">=", "gt": ">", "le": "<=", "lt": "<"}


def part_table(parts: Mapping[str, type[BaseModel]]) -> list[dict[str, Any]]:
    """Every part of a registry as its class says.

    Returns
    -------
    rows : list of dict
        Kind, summary (first paragraph of the docstring) and parameters: name, default (None where it must be given)
        and range as a text.
    """
    return [
        {
            "kind": kind,
            "summary": " ".join(cleandoc(part.__doc__ or "").split("\n\n")[0].split()),
            "parameters": [
                {"name": name, "default": _default(field), "range": _range(field)}
                for name, field in part.model_fields.items()
                if name != "kind"
            ],
        }
        for kind, part in parts.items()
    ]


def part_lines(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows of `part_table` for people.

    Examples
    --------
    >>> parameters = [{"name": "leak_m3h", "default": 10.0, "range": ">= 0"}]
    >>> print(part_lines([{"kind": "leak", "summary": "Water flows back.", "parameters": parameters}]))
    leak
      Water flows back.
      leak_m3h: 10.0 (>= 0)
    """
    lines = []
    for row in rows:
        lines += [row["kind"], _indented(row["summary"])]
        for parameter in row["parameters"]:
            default = "must be given" if parameter["default"] is None else parameter["default"]
            allowed = f" ({parameter['range']})" if parameter["range"] else ""
            lines.append(_indented(f"{parameter['name']}: {default}{allowed}"))
    return "\n".join(lines)


def effect_lines(table: Sequence[Mapping[str, Any]]) -> str:
    """Effects for people: name, component and purpose, then one line a parameter.

    Examples
    --------
    >>> print(effect_lines([{"name": "motor_slip", "component": "drive", "summary": "Motors slip.",
    ...     "parameters": [{"name": "slip", "unit": "1", "low": 0.0, "high": 0.15, "neutral": 0.0}]}]))
    motor_slip (drive)
      Motors slip.
      slip: 0 to 0.15 [1]
    """
    lines = []
    for row in table:
        lines += [f"{row['name']} ({row['component']})", _indented(row["summary"])]
        for parameter in row["parameters"]:
            allowed = f"{parameter['low']:g} to {parameter['high']:g}" if "low" in parameter else "any"
            allowed = ", ".join(parameter["choices"]) if "choices" in parameter else allowed
            allowed = f"tables with {', '.join(parameter['parts'])}" if "parts" in parameter else allowed
            unit = f" [{parameter['unit']}]" if "unit" in parameter else ""
            value = None if "parts" in parameter else parameter.get("default")
            default = "" if value is None else f", default {value if isinstance(value, str) else format(value, 'g')}"
            lines.append(_indented(f"{parameter['name']}: {allowed}{unit}{default}"))
    return "\n".join(lines)


def _indented(text: str) -> str:
    return fill(text, SCREEN_WIDTH, initial_indent="  ", subsequent_indent="  ")


def _default(field: FieldInfo) -> Any:
    if field.is_required():
        return None
    return field.default.model_dump(mode="json") if isinstance(field.default, BaseModel) else field.default


def _range(field: FieldInfo) -> str:
    if get_origin(field.annotation) is Literal:
        return ", ".join(map(str, get_args(field.annotation)))
    limits = [
        f"{sign} {getattr(rule, name):g}"
        for rule in field.metadata
        for name, sign in _LIMITS.items()
        if hasattr(rule, name)
    ]
    return ", ".join(limits)
