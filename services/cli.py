"""The command `wetwell`: its groups, and what it says when a user errs."""

import sys
from typing import NoReturn

import typer

from wetwell.protocols.errors import WetwellError
from wetwell.services.commands import (
    alarms,
    dashboard,
    doctor,
    fleet,
    gap,
    gateway,
    historian,
    judging,
    listing,
    live,
    recordings,
    token,
)

app = typer.Typer(
    name="wetwell",
    help="Watches wastewater pump stations and says whether a pump or the rising main is at fault.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
for group in (live, dashboard, historian, fleet, recordings, judging, listing, doctor):
    app.add_typer(group.app)
app.add_typer(gap.app, name="gap")
app.add_typer(alarms.app, name="alarms")
app.add_typer(token.app, name="token")
app.add_typer(gateway.app, name="gateway")


def main() -> NoReturn:
    """Run the command; an error of the user's is one line on standard error and exit code 2."""
    try:
        app(standalone_mode=True)
    except WetwellError as error:
        typer.echo(f"wetwell: {error}", err=True)
    except ExceptionGroup as group:
        matched, rest = group.split(WetwellError)
        if rest is not None or matched is None:
            raise
        typer.echo(f"wetwell: {_first(matched)}", err=True)
    sys.exit(2)


def _first(group: BaseExceptionGroup[BaseException]) -> BaseException:
    error: BaseException = group
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return error
