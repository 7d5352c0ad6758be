"""Examples of the keys of a schema, taken from whole files that lie beside it."""

import json
import re
import tomllib
from collections.abc import Iterator
from importlib.resources import files
from typing import Any

from wetwell.services.schemas.described import tables_of

FOLDER = files(__package__) / "examples"
READERS = {".toml": tomllib.loads, ".json": json.loads}
"""By the end of a file's name."""

Table = dict[str, Any]


def examples_of(name: str) -> list[Table]:
    """Whole files or messages that the schema allows: `NAME.*` and `NAME-*.*` in the folder of examples."""
    found = sorted(
        (file for file in FOLDER.iterdir() if re.fullmatch(rf"{name}(-[a-z]+)?\.(toml|json)", file.name)),
        key=lambda file: file.name,
    )
    return [READERS[f".{file.name.rpartition('.')[2]}"](file.read_text(encoding="utf-8")) for file in found]


def add_examples(schema: Table, examples: list[Table]) -> None:
    """Write into each key of a schema the first value that one of the examples has for it, tables apart."""
    for example in examples:
        _add(schema, schema, example)


def _add(schema: Table, table: Table, values: Table) -> None:
    for key, value in values.items():
        rule = _rule_of(table, key)
        if rule is None:
            continue
        tables = list(tables_of(schema, rule))
        for inner in tables:
            for part in _parts(value):
                if _fits(inner, part):
                    _add(schema, inner, part)
        if not tables and value is not None:
            rule.setdefault("examples", [value])


def _rule_of(table: Table, key: str) -> Table | None:
    patterns = table.get("patternProperties", {})
    found = table.get("properties", {}).get(key)
    return found or next((rule for pattern, rule in patterns.items() if re.match(pattern, key)), None)


def _parts(value: Any) -> Iterator[Any]:
    """The value itself, what is in its list, and what stands by name in its table."""
    yield value
    yield from value if isinstance(value, list) else value.values() if isinstance(value, dict) else ()


def _fits(table: Table, part: Any) -> bool:
    """Whether a part is such a table: it has no other keys, and what is fixed is so in it."""
    rules = table["properties"]
    return (
        isinstance(part, dict)
        and part.keys() <= rules.keys()
        and all(part.get(key, rule.get("default")) == rule["const"] for key, rule in rules.items() if "const" in rule)
    )
