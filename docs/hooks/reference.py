"""Reference pages made from the code: commands, settings, messages, registers, effects, faults, inflow models."""

from collections.abc import Iterator, Mapping
from typing import Any, Literal, get_args, get_origin

import names
import python_api
import schemas
import typer
from pydantic import BaseModel

from wetwell.protocols.modbus.registers import register_table
from wetwell.services.cli import app
from wetwell.services.schemas.messages import message_models, message_schema
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
    models = list(message_models())
    shown = {model.__name__ for model in models} | {"Station", *schema_named("station")["$defs"]}
    for model in models:
        schema = message_schema(model)
        text += [f"## {model.__name__}", "", schema["description"], "", schemas.key_table(schema, schema)]
        for name, part in schema.get("$defs", {}).items():
            if "properties" in part and name not in shown:
                text += [f"### {name}", "", part["description"], "", schemas.key_table(schema, part)]
                shown.add(name)
    return "\n".join(text)


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
