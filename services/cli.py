"""The command `wetwell`: its groups, and what it says when a user errs."""

import atexit
import gc
import os
import sys
from typing import Annotated, NoReturn

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
from wetwell.services.commands.inputs import CommandGroup
from wetwell.services.commands.options import ADMINISTER, GAP, RUN

app = typer.Typer(
    name="wetwell",
    cls=CommandGroup,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # rich takes a quarter of a second to load, more than all else that help needs
    context_settings={"max_content_width": 100},
)
app.add_typer(live.app)
app.add_typer(gateway.app, name="gateway", rich_help_panel=RUN)
app.add_typer(alarms.app, name="alarms", rich_help_panel=RUN)
for group in (historian, dashboard, fleet, recordings, judging):
    app.add_typer(group.app)
app.add_typer(gap.app, name="gap", rich_help_panel=GAP)
for group in (doctor, listing):
    app.add_typer(group.app)
app.add_typer(token.app, name="token", rich_help_panel=ADMINISTER)


def _print_version(is_wanted: bool) -> None:
    if is_wanted:
        from importlib.metadata import version  # noqa: PLC0415 - of use to this option only

        typer.echo(f"wetwell {version('wetwell')}")
        raise typer.Exit


@app.callback()
def wetwell(
    _version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version and end.")
    ] = False,
) -> None:
    """Watches wastewater pump stations and says whether a pump or the rising main is at fault."""


def main() -> NoReturn:
    """Run the command; an error of the user's is one line on standard error and exit code 2."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices are small: threads would only wait for each other
    gc.set_threshold(_NEW_OBJECTS)
    atexit.register(_leave_cycles)
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


def _leave_cycles() -> None:
    """Let Python end without a last search for cycles, a quarter of a short command; DuckDB would complain of it."""
    if "duckdb" not in sys.modules:
        gc.freeze()


_NEW_OBJECTS = 50_000
"""Count of new objects from search to search for cycles: what loads and what streams makes none worth a look."""


def _first(group: BaseExceptionGroup[BaseException]) -> BaseException:
    error: BaseException = group
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return error
