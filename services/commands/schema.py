"""JSON Schemas, for editors and programs."""

from typing import Annotated

import typer

from wetwell.services.commands.inputs import about
from wetwell.services.commands.options import ADMINISTER, JsonOption, print_result

app = typer.Typer()


@app.command(cls=about("--name"), rich_help_panel=ADMINISTER)
def schema(
    name: Annotated[str | None, typer.Option("--name", metavar="NAME", help="Such as station.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Print the JSON Schema of a file or a message, for editors; without a name list what there is."""
    from wetwell.services.schemas.registry import SCHEMAS, schema_named

    if name is not None:
        return print_result(schema_named(name), as_json=True)
    rows = [{"schema": key, "of": words} for key, (words, _) in SCHEMAS.items()]
    return print_result({"schemas": rows}, as_json=as_json)
