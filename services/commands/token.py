"""Tokens for the dashboard and for acts on alarms."""

from pathlib import Path
from typing import Annotated

import typer

from wetwell.protocols.errors import ConfigError
from wetwell.services.commands.inputs import CommandGroup
from wetwell.services.commands.options import ConfigOption, JsonOption, number, print_result
from wetwell.services.security.role import Role

app = typer.Typer(
    cls=CommandGroup, no_args_is_help=True, help="Tokens of people and programs that use the dashboard."
)

FileOption = Annotated[
    Path | None,
    typer.Option("--file", metavar="FILE", help="File of tokens; default: the setting security.tokens_file."),
]
NameOption = Annotated[
    str, typer.Option("--name", metavar="NAME", help="Who holds it; stands in the record of acts.")
]


@app.command()
def new(
    name: NameOption,
    role: Annotated[Role, typer.Option("--role", help="viewer: may look; operator: may also act.")] = "viewer",
    days: Annotated[
        int, number("--days", low=0, high=3650, metavar="DAYS", help="Days until it ends; 0: it does not end.")
    ] = 365,
    file: FileOption = None,
    config: ConfigOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Make a token and print it, this once."""
    from wetwell.services.security.tokens import new_token

    path = _file(file, config)
    token = new_token(path, name, role, days)
    if as_json:
        print_result({"name": name, "role": role, "token": token, "file": str(path)}, as_json=True)
    else:
        typer.echo(token)


@app.command("list")
def list_(file: FileOption = None, config: ConfigOption = None, *, as_json: JsonOption = False) -> None:
    """Print who holds a token."""
    from wetwell.services.security.tokens import read_holders, today

    holders = read_holders(_file(file, config))
    if as_json:
        told = [holder.model_dump(mode="json", exclude={"sha256"}) for holder in holders]
        print_result({"holders": told}, as_json=True)
    else:
        for holder in holders:
            until = "without end" if holder.until is None else f"until {holder.until}"
            ended = ", over" if holder.has_ended(today()) else ""
            typer.echo(f"{holder.name}\t{holder.role}\t{until}{ended}")


@app.command()
def revoke(
    name: NameOption, file: FileOption = None, config: ConfigOption = None, *, as_json: JsonOption = False
) -> None:
    """Take a token out of the file; it is refused from now on."""
    from wetwell.services.security.tokens import revoke_token

    path = _file(file, config)
    revoke_token(path, name)
    print_result({"revoked": name, "file": str(path)}, as_json=as_json)


def _file(file: Path | None, config: Path | None) -> Path:
    from wetwell.services.runtime.settings import load_settings

    path = file or load_settings(config).security.tokens_file
    if path is None:
        raise ConfigError("no file of tokens: give --file, or set security.tokens_file")
    return path
