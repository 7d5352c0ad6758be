"""Reference pages of files and messages, made from their JSON Schemas: keys with type, unit, rule and example."""

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from wetwell.services.schemas.registry import SCHEMAS, schema_named

ROOT = Path(__file__).parents[2]
EXAMPLES = {
    "station": ("simulator/stations/alpha.toml", "simulator/stations/twin.toml", "docs/add-a-station.md"),
    "scenario": ("simulator/scenarios/demo.toml", "simulator/scenarios/paper.toml"),
    "mapping": ("docs/convert.md",),
    "preparation": ("docs/field-data.md",),
    "plc": ("services/gateway/example.toml",),
}
"""Files of the repository, or pages with TOML blocks, in which the examples of the keys stand."""
LIMITS = {
    "minimum": "≥ {}",
    "exclusiveMinimum": "> {}",
    "maximum": "≤ {}",
    "exclusiveMaximum": "< {}",
    "minLength": "at least {} characters",
    "maxLength": "at most {} characters",
    "minItems": "at least {}",
    "maxItems": "at most {}",
    "pattern": "`{}`",
    "const": "`{}`",
    "format": "{}",
}
HEAD = ("key", "type", "unit", "default", "rule", "example", "meaning")
Row = tuple[str, ...]


def schema_pages() -> dict[str, str | bytes]:
    """Markdown of each schema, and the schema itself for editors."""
    pages: dict[str, str | bytes] = {}
    for name, (words, _) in SCHEMAS.items():
        schema = schema_named(name)
        pages[f"{name}-keys.md"] = "\n".join(_page(name, words, schema))
        pages[f"schemas/{name}.json"] = json.dumps(schema, indent=2, ensure_ascii=False).encode() + b"\n"
    return pages


def _page(name: str, words: str, schema: dict[str, Any]) -> Iterator[str]:
    yield f"# Keys: {words}\n"
    yield "Made from the model that checks it."
    yield f"For editors: [{name}.json](schemas/{name}.json), or `wetwell schema {name}`.\n"
    for place, table, examples in _tables(schema, _examples(name)):
        yield f"## {place}\n"
        yield f"{table.get('description', '')}\n"
        rows = [
            _row(key, rule, schema, key in table.get("required", ()), [one[key] for one in examples if key in one])
            for key, rule in {**table.get("properties", {}), **table.get("patternProperties", {})}.items()
        ]
        yield "\n".join(_line(cells) for cells in (HEAD, ("---",) * len(HEAD), *rows)) + "\n"


def _tables(
    schema: dict[str, Any], examples: list[dict[str, Any]]
) -> Iterator[tuple[str, dict[str, Any], list[dict[str, Any]]]]:
    """Place, rules and examples of the file itself and of each table in it, once each."""
    waiting, seen = [("The file", schema, examples)], set[str]()
    while waiting:
        place, table, known = waiting.pop(0)
        yield place, table, known
        for key, rule in table.get("properties", {}).items():
            for name, is_list in _references(rule):
                if name not in seen and "properties" in schema["$defs"][name]:
                    seen.add(name)
                    inside = [part for one in known if key in one for part in _tables_in(one[key])]
                    path = key if place == "The file" else f"{place.strip('`[]')}.{key}"
                    waiting.append((f"`[[{path}]]`" if is_list else f"`[{path}]`", schema["$defs"][name], inside))


def _references(rule: Mapping[str, Any], is_list: bool = False) -> Iterator[tuple[str, bool]]:
    if "$ref" in rule:
        yield rule["$ref"].rpartition("/")[2], is_list
    for inner in (*rule.get("anyOf", ()), *rule.get("allOf", ()), *rule.get("oneOf", ())):
        yield from _references(inner, is_list)
    if isinstance(rule.get("items"), dict):
        yield from _references(rule["items"], is_list=True)


def _tables_in(value: Any) -> list[dict[str, Any]]:
    return [one for one in (value if isinstance(value, list) else [value]) if isinstance(one, dict)]


def _row(key: str, rule: dict[str, Any], schema: dict[str, Any], is_needed: bool, examples: list[Any]) -> Row:
    kinds, rules = _told(rule, schema)
    has_default = rule.get("default") is not None and "table" not in kinds
    default = "must be given" if is_needed else _value(rule["default"]) if has_default else ""
    example = next((_value(one) for one in examples if not _tables_in(one)), "")
    cells = (f"`{key}`", kinds, rule.get("unit", ""), default, rules, example or (default if "`" in default else ""))
    return (*cells, rule.get("description", ""))


def _told(rule: Mapping[str, Any], schema: dict[str, Any]) -> tuple[str, str]:
    """Type and rule of a key in words."""
    if "$ref" in rule:
        name = rule["$ref"].rpartition("/")[2]
        found = schema["$defs"][name]
        return (f"table {name}", "") if "properties" in found or "oneOf" in found else _told(found, schema)
    if choices := [one for one in rule.get("anyOf", rule.get("oneOf", ())) if one != {"type": "null"}]:
        told = [_told(one, schema) for one in choices]
        return " or ".join(dict.fromkeys(kind for kind, _ in told)), "; ".join(dict.fromkeys(r for _, r in told if r))
    if "enum" in rule:
        return "text", "one of " + ", ".join(f"`{one}`" for one in rule["enum"])
    kind = rule.get("type", "any")
    kind = " or ".join(one for one in kind if one != "null") if isinstance(kind, list) else kind
    limits = [words.format(rule[limit]) for limit, words in LIMITS.items() if limit in rule]
    if kind == "array":
        if inner := rule.get("prefixItems"):
            return f"list of {len(inner)}: " + ", ".join(_told(one, schema)[0] for one in inner), ""
        inside, inside_rule = _told(rule.get("items", {}), schema)
        return f"list of {inside}", "; ".join([*limits, inside_rule]).strip("; ")
    return {"string": "text", "object": "table"}.get(kind, kind), "; ".join(limits)


def _value(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False, default=str)
    return f"`{text if len(text) <= 60 else text[:57] + '...'}`"


def _examples(name: str) -> list[dict[str, Any]]:
    found = []
    for place in EXAMPLES.get(name, ()):
        text = (ROOT / place).read_text(encoding="utf-8")
        blocks = re.findall(r"^```toml\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
        for block in blocks if place.endswith(".md") else [text]:
            try:
                found.append(tomllib.loads(block))
            except tomllib.TOMLDecodeError:
                continue  # a block that shows a part of a file
    return found


def _line(cells: Row) -> str:
    return "| " + " | ".join(str(cell).replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"
