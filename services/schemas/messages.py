"""Schemas of all messages of the bus, and of the parts that several of them share."""

from collections.abc import Iterator
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

import wetwell.protocols.messages
from wetwell.protocols.messages.message import Message
from wetwell.services.schemas.described import described_schema
from wetwell.services.schemas.examples import add_examples, examples_of


def message_models() -> Iterator[type[Message]]:
    """Models of all messages, module by module."""
    for name in sorted(name for _, name, _ in iter_modules(wetwell.protocols.messages.__path__)):
        module = import_module(f"wetwell.protocols.messages.{name}")
        for model in vars(module).values():
            is_own = isinstance(model, type) and model.__module__ == module.__name__
            if is_own and issubclass(model, Message) and model is not Message:
                yield model


def message_schema(model: type[Message]) -> dict[str, Any]:
    """JSON Schema of a message: each key with meaning, unit, default, rule and example."""
    schema = described_schema(model, mode="serialization")
    add_examples(schema, examples_of(model.__name__.lower()))
    return schema
