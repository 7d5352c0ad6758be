"""Reference pages made from the code: commands, settings, messages, registers, effects, faults, inflow models."""

import importlib
import pkgutil
from collections.abc import Iterator, Mapping
from typing import Any, Literal, get_args, get_origin

import names
import python_api
import schemas
import typer
from pydantic import BaseModel

import wetwell.protocols.messages
from wetwell.protocols.messages.message import Message
from wetwell.protocols.modbus.registers import register_table
from wetwell.services.cli import app
from wetwell.services.schemas.described import described_schema
from wetwell.services.schemas.examples import add_examples, examples_of
from wetwell.services.schemas.registry import schema_named
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.faults import FAULTS
from wetwell.simulator.inflow import INFLOWS


def pages() -> dict[str, str]:
    """Markdown of each page, by file name."""
    return {
        "commands.md": "# Commands\n\n" + "\n".join(_command(typer.main.get_command(app), "wetwell")),
        "python.md": python_api.python_page(),
        "messages.md": _messages(),
        "registers.md": _registers(),
        "effects.md": _parts("Effects", EFFECTS, "station"),
        "faults.md": _parts("Faults", FAULTS, "scenario"),
        "inflows.md": _parts("Inflow models", INFLOWS, "scenario"),
        "names.md": names.names_page(),
    }


def _command(command: Any, name: str) -> Iterator[str]:
    yield f"## `{name}`\n\n{(command.help or '').strip()}\n"
    rows = [
        (_names(option), _default(option), getattr(option, "help", None) or "")
        for option in command.params
        if option.name != "help"
    ]
    if rows:
        yield _table(("option", "default", "meaning"), rows)
    for child_name, child in getattr(command, "commands", {}).items():
        yield from _command(child, f"{name} {child_name}")


def _names(option: Any) -> str:
    if option.param_type_name == "argument":
        return f"`{(option.metavar or option.name).upper()}`"
    return f"`{', '.join(option.opts)}{'' if option.is_flag else ' ' + _value(option)}`"


def _value(option: Any) -> str:
    annotation = option.type_descriptor.annotation
    if get_origin(annotation) is Literal:
        return "|".join(map(str, get_args(annotation)))
    return str(option.metavar or getattr(annotation, "__name__", "VALUE").upper())


def _default(option: Any) -> str:
    if option.required:
        return "must be given"
    is_plain = option.default is not None and not callable(option.default) and option.default not in (False, [], ())
    return f"`{option.default}`" if is_plain else ""


def _messages() -> str:
    text = ["# Messages", "", "JSON on the bus. A key that is not listed is ignored; a new one has a default.", ""]
    for model in _message_models():
        schema = described_schema(model, mode="serialization")
        add_examples(schema, examples_of(model.__name__.lower()))
        text += [f"## {model.__name__}", "", schema["description"], "", schemas.key_table(schema, schema)]
    return "\n".join(text)


def _message_models() -> Iterator[type[Message]]:
    for name in sorted(name for _, name, _ in pkgutil.iter_modules(wetwell.protocols.messages.__path__)):
        module = importlib.import_module(f"wetwell.protocols.messages.{name}")
        for model in vars(module).values():
            is_own = isinstance(model, type) and model.__module__ == module.__name__
            if is_own and issubclass(model, Message) and model is not Message:
                yield model


def _registers() -> str:
    rows = [
        (str(row.address), row.table, f"`{row.name}`", row.type, row.unit, row.access, row.description)
        for row in register_table(3, 3)
    ]
    head = ("address", "table", "name", "type", "unit", "access", "meaning")
    intro = "Of a station with three pumps; `wetwell modbus-map --station FILE --format csv` prints those of yours."
    rules = "Addresses count from zero. Measured values are read by function codes 03 and 04."
    return f"# Modbus registers\n\n{intro}\n{rules}\n\n" + _table(head, rows)


def _parts(title: str, parts: Mapping[str, type[BaseModel]], file: str) -> str:
    """Parts that a file may name, each with the keys that the schema of the file has for it."""
    schema = schema_named(file)
    text = [f"# {title}: parameters", ""]
    for name, part in parts.items():
        table = schema["$defs"][part.__name__]
        text += [f"## `{name}`", "", table["description"], "", schemas.key_table(schema, table)]
    return "\n".join(text)


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    if not rows:
        return ""
    return "\n".join(map(_line, [head, ("---",) * len(head), *rows])) + "\n"


def _line(cells: tuple[str, ...]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"
