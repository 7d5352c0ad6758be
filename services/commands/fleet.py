"""Many stations on Dask."""

from pathlib import Path
from typing import Annotated, Any

import typer

from wetwell.protocols.errors import ConfigError
from wetwell.services.commands.inputs import about
from wetwell.services.commands.options import RUN, ConfigOption, ZenohOption, number, run, settings_of

app = typer.Typer()


@app.command(cls=about("--stations"), rich_help_panel=RUN)
def fleet(
    stations: Annotated[
        Path, typer.Option("--stations", metavar="PATH", help="Folder of station files, or a CSV table of them.")
    ],
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Dask scheduler, such as tcp://HOST:8786; default: here."),
    ] = None,
    workers: Annotated[int | None, number(low=1, help="Workers to start, if no scheduler is given.")] = None,
    shards: Annotated[int | None, number(low=1, help="Parts that move between workers as a whole.")] = None,
    zenoh: ZenohOption = None,
    config: ConfigOption = None,
) -> None:
    """Judge any number of stations on the workers of Dask; a station file that comes or goes is followed."""
    given: dict[str, Any] = {"scheduler": scheduler, "workers": workers, "shards": shards}
    settings = settings_of(config, zenoh, more={"fleet": {k: v for k, v in given.items() if v is not None}})
    try:
        from wetwell.services.fleet.controller import serve_fleet
    except ImportError as error:
        raise ConfigError(f"fleet: needs the extra 'fleet' (pip install '.[fleet]'): {error}") from error
    run(settings, serve_fleet(settings, stations))
