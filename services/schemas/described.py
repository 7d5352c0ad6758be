"""JSON Schema of a model, with what its docstrings say of each key, and the unit that its name carries."""

import re
from collections.abc import Iterator
from inspect import cleandoc
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.json_schema import JsonSchemaMode

UNITS = {
    "_h2_m5": "h²/m⁵",
    "_m3h": "m³/h",
    "_per_kwh": "currency/kWh",
    "_m2": "m²",
    "_m3": "m³",
    "_kw": "kW",
    "_hz": "Hz",
    "_percent": "%",
    "_days": "d",
    "_ms": "ms",
    "_mb": "MB",
    "_h": "h",
    "_m": "m",
    "_s": "s",
    "_v": "V",
    "_a": "A",
}
"""By the end of a name, the longest first."""
_ENTRY = re.compile(r"^([\w, ]+?) : .*$")


def described_schema(model: type[BaseModel], mode: JsonSchemaMode = "validation") -> dict[str, Any]:
    """JSON Schema of a model: each property also has `description` and `unit`, where they are known.

    Examples
    --------
    >>> from wetwell.protocols.station.sump import Sump
    >>> described_schema(Sump)["properties"]["area_m2"]["unit"]
    'm²'
    """
    schema = model.model_json_schema(mode=mode)
    tables = {"": schema, **schema.get("$defs", {})}
    for part in {model, *_parts(model)}:
        table = tables[""] if part is model else tables.get(part.__name__)
        if table is None:
            continue
        text = cleandoc(part.__doc__ or "")
        table["description"] = _summary(text)
        words = _words(text)
        for key, rule in table.get("properties", {}).items():
            said = words.get(key, "")
            if said and "description" not in rule:
                rule["description"] = said
            unit = unit_of(key, said)
            if unit and "unit" not in rule:
                rule["unit"] = unit
    return schema


def unit_of(name: str, said: str = "") -> str:
    """Unit of a key: what stands in brackets at the end of its words, or what its name carries.

    Examples
    --------
    >>> unit_of("level_m"), unit_of("curve", "Head over flow. [m]"), unit_of("name")
    ('m', 'm', '')
    """
    if bracket := re.search(r"\[([^\]]+)\]\.?$", said):
        return bracket[1]
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), "")


def _parts(model: type[BaseModel], seen: frozenset[type] = frozenset()) -> Iterator[type[BaseModel]]:
    """Models that stand in the fields of a model, at any depth."""
    for field in model.model_fields.values():
        for part in _models(field.annotation):
            if part not in seen:
                yield part
                yield from _parts(part, seen | {model, part})


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in get_args(annotation):
        yield from _models(inner)


def _summary(text: str) -> str:
    return " ".join(
        re.split(r"^(?:Parameters|Attributes|Raises|References)\n-+$", text, flags=re.MULTILINE)[0].split()
    )


def _words(text: str) -> dict[str, str]:
    """What a docstring says of each key under Parameters or Attributes."""
    found = re.search(r"^(?:Parameters|Attributes)\n-+\n(.*?)(?=^\w+\n-+$|\Z)", text, flags=re.MULTILINE | re.DOTALL)
    words: dict[str, str] = {}
    names: list[str] = []
    for line in (found[1] if found else "").splitlines():
        entry = _ENTRY.match(line) if not line.startswith(" ") else None
        if entry:
            names = [name.strip() for name in entry[1].split(",")]
            words |= dict.fromkeys(names, "")
        else:
            words |= {name: f"{words[name]} {line.strip()}".strip() for name in names}
    return words
