"""Reference pages of files and messages, made from their JSON Schemas: keys with type, unit, rule and example."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from wetwell.services.schemas.described import tables_of
from wetwell.services.schemas.registry import SCHEMAS, schema_named

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
    for place, table in _tables(schema):
        yield f"## {place}\n"
        yield f"{table.get('description', '')}\n"
        yield key_table(schema, table)


def key_table(schema: dict[str, Any], table: dict[str, Any]) -> str:
    """Markdown table of the keys of one table of a schema."""
    rows = [
        _row(key, rule, schema, key in table.get("required", ()))
        for key, rule in {**table.get("properties", {}), **table.get("patternProperties", {})}.items()
    ]
    return "\n".join(_line(cells) for cells in (HEAD, ("---",) * len(HEAD), *rows)) + "\n"


def _tables(schema: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Place and rules of the file itself and of each table in it, once each."""
    waiting, seen = [("", "The file", schema)], set[str]()
    while waiting:
        path, heading, table = waiting.pop(0)
        yield heading, table
        for key, rule in table.get("properties", {}).items():
            for inner in tables_of(schema, rule):
                if inner["title"] not in seen:
                    seen.add(inner["title"])
                    place = f"{path}.{key}".lstrip(".") + (".NAME" if "additionalProperties" in rule else "")
                    waiting.append((place, _heading(place, rule, inner), inner))


def _heading(place: str, rule: Mapping[str, Any], table: Mapping[str, Any]) -> str:
    is_list = rule.get("type") == "array" or any(one.get("type") == "array" for one in rule.get("anyOf", ()))
    fixed = [f' {key} = "{one["const"]}"' for key, one in table["properties"].items() if "const" in one]
    return f"`[[{place}]]{''.join(fixed)}`" if is_list else f"`[{place}]{''.join(fixed)}`"


def _row(key: str, rule: dict[str, Any], schema: dict[str, Any], is_needed: bool) -> Row:
    kinds, rules = _told(rule, schema)
    has_default = rule.get("default") is not None and "table" not in kinds
    default = "must be given" if is_needed else _value(rule["default"]) if has_default else ""
    example = _value(rule["examples"][0]) if "examples" in rule else default if "`" in default else ""
    return f"`{key}`", kinds, rule.get("unit", ""), default, rules, example, rule.get("description", "")


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
    if kind == "array" and (inner := rule.get("prefixItems")):
        kind = f"list of {len(inner)}: " + ", ".join(_told(one, schema)[0] for one in inner)
    elif kind == "array":
        inside, inside_rule = _told(rule.get("items", {}), schema)
        kind, limits = f"list of {inside}", [*limits, inside_rule]
    elif kind == "object" and isinstance(rule.get("additionalProperties"), dict):
        kind = f"{_told(rule['additionalProperties'], schema)[0]} by name"
    return {"string": "text", "object": "table"}.get(kind, kind), "; ".join(filter(None, limits))


def _value(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False, default=str)
    return f"`{text if len(text) <= 60 else text[:57] + '...'}`"


def _line(cells: Row) -> str:
    return "| " + " | ".join(str(cell).replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"
