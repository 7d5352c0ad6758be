"""History: the daemon that keeps it, questions to it, recordings out of it and into it."""

from pathlib import Path
from typing import Annotated

import typer

from wetwell.services.commands.options import ConfigOption, ZenohOption, run, settings_of
from wetwell.services.settings import Settings

app = typer.Typer()

DataOption = Annotated[
    Path | None, typer.Option("--data", metavar="DIR", help="Folder of the history; default: historian.folder.")
]


@app.command()
def historian(data: DataOption = None, zenoh: ZenohOption = None, config: ConfigOption = None) -> None:
    """Keep samples, verdicts and alarms of all stations, and answer questions about them."""
    from wetwell.services.historian.daemon import serve_historian

    settings = _with_data(settings_of(config, zenoh), data)
    run(settings, serve_historian(settings))


def _with_data(settings: Settings, data: Path | None) -> Settings:
    if data is None:
        return settings
    historian = settings.historian.model_copy(update={"folder": data})
    return settings.model_copy(update={"historian": historian})
