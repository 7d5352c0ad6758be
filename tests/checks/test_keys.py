"""Each public key of a file or message says what it means, and shows a value where its rule does not."""

import importlib
import pkgutil

import pytest

import wetwell.protocols.messages
from wetwell.protocols.messages.message import Message
from wetwell.services.schemas.described import described_schema, tables_of
from wetwell.services.schemas.registry import SCHEMAS, schema_named


def messages():
    for name in sorted(one.name for one in pkgutil.iter_modules(wetwell.protocols.messages.__path__)):
        module = importlib.import_module(f"wetwell.protocols.messages.{name}")
        for model in vars(module).values():
            is_own = isinstance(model, type) and model.__module__ == module.__name__
            if is_own and issubclass(model, Message) and model is not Message:
                yield model


def keys(schema):
    for place, table in {"": schema, **schema.get("$defs", {})}.items():
        for key, rule in {**table.get("properties", {}), **table.get("patternProperties", {})}.items():
            yield f"{place}.{key}", rule


def shows_itself(schema, rule):
    """Whether one sees what to write: a table, listed values, a flag, a default, a number between two limits."""
    if next(tables_of(schema, rule), None) is not None or rule.get("default") not in (None, (), [], {}, ""):
        return True
    choices = [one for one in rule.get("anyOf", [rule]) if one != {"type": "null"}]
    return all(
        "enum" in one or "const" in one or one.get("type") == "boolean" or {"minimum", "maximum"} <= one.keys()
        for one in choices
    )


@pytest.mark.parametrize("name", SCHEMAS)
def test_each_key_of_a_file_has_a_meaning(name):
    assert [place for place, rule in keys(schema_named(name)) if not rule.get("description")] == []


@pytest.mark.parametrize("name", SCHEMAS)
def test_each_key_of_a_file_has_an_example_or_needs_none(name):
    schema = schema_named(name)
    bare = [place for place, rule in keys(schema) if "examples" not in rule and not shows_itself(schema, rule)]
    assert bare == []


@pytest.mark.parametrize("model", list(messages()), ids=lambda model: model.__name__)
def test_each_key_of_a_message_has_a_meaning(model):
    schema = described_schema(model, mode="serialization")
    assert [place for place, rule in keys(schema) if not rule.get("description")] == []
