"""JSON Schema of a model, with what its docstrings say of each key, and the unit that its name carries."""

import re
from collections.abc import Iterable, Iterator, Mapping
from inspect import cleandoc
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.json_schema import JsonSchemaMode

UNITS = {
    "_h2_m5": "h²/m⁵",
    "_hz_m": "Hz/m",
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
_UNIT = re.compile(r"\s*\[([^\]]+)\]\.?$")
"""At the end of what is said of a key."""
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
    describe(schema, [model])
    return schema


def describe(schema: dict[str, Any], models: Iterable[type[BaseModel]]) -> None:
    """Write into a schema what the docstrings of its models, and of what they build on and hold, say of each key.

    A key of which they say nothing, and whose value is a table, has what is said of that table.
    """
    tables = schema.get("$defs", {})
    for part in dict.fromkeys(part for model in models for part in (model, *_parts(model))):
        table = schema if part.__name__ == schema.get("title") else tables.get(part.__name__)
        if table is None:
            continue
        table["description"] = _summary(cleandoc(part.__doc__ or ""))
        words = _words_of(part)
        for key, rule in table.get("properties", {}).items():
            if "const" in rule:
                words.setdefault(key, "Which of the forms the table has.")
            said = rule.get("description", words.get(key, ""))
            rule["description"] = _UNIT.sub("", said)
            unit = unit_of(key, said)
            if unit and "unit" not in rule:
                rule["unit"] = unit
    for table in (schema, *tables.values()):
        for rule in table.get("properties", {}).values():
            if not rule.get("description"):
                rule["description"] = next((inner["description"] for inner in tables_of(schema, rule)), "")


def tables_of(schema: Mapping[str, Any], rule: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Tables that a key may hold, alone, in a list, by name, or as one of several.

    Examples
    --------
    >>> schema = {"$defs": {"Pump": {"title": "Pump", "properties": {}}}}
    >>> [table["title"] for table in tables_of(schema, {"type": "array", "items": {"$ref": "#/$defs/Pump"}})]
    ['Pump']
    """
    if "$ref" in rule:
        found = schema["$defs"][rule["$ref"].rpartition("/")[2]]
        if "properties" in found:
            yield found
        else:
            yield from tables_of(schema, found)
    inner = [one for key in ("anyOf", "oneOf") for one in rule.get(key, ())]
    for one in (*inner, rule.get("items"), rule.get("additionalProperties")):
        if isinstance(one, dict):
            yield from tables_of(schema, one)


def unit_of(name: str, said: str = "") -> str:
    """Unit of a key: what stands in brackets at the end of its words, or what its name carries.

    Examples
    --------
    >>> unit_of("level_m"), unit_of("curve", "Head over flow. [m]"), unit_of("name")
    ('m', 'm', '')
    """
    if bracket := _UNIT.search(said):
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


def _words_of(model: type[BaseModel]) -> dict[str, str]:
    """What its docstring says of each key, and those of its bases of the others."""
    words: dict[str, str] = {}
    for base in reversed(model.__mro__):
        if issubclass(base, BaseModel):
            words |= {key: said for key, said in _words(cleandoc(base.__doc__ or "")).items() if said}
    return words


def _summary(text: str) -> str:
    """What comes before the sections, without equations in lines of their own: editors and tables do not set them."""
    words = re.split(r"^(?:Parameters|Attributes|Raises|References)\n-+$", text, flags=re.MULTILINE)[0]
    return " ".join(re.sub(r"\$\$.*?\$\$", "", words, flags=re.DOTALL).split())


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
