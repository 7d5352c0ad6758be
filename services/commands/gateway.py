"""The gateway: PLCs polled for ever, or once, or only their files checked."""

from pathlib import Path
from typing import Annotated

import typer

from wetwell.protocols.errors import ConfigError
from wetwell.services.commands.inputs import CommandGroup, about
from wetwell.services.commands.options import (
    ConfigOption,
    JsonOption,
    ZenohOption,
    print_result,
    run,
    settings_of,
)

app = typer.Typer(cls=CommandGroup, invoke_without_command=True)

PlcOption = Annotated[Path, typer.Option("--plc", metavar="FILE", help="TOML file of one PLC, or of several.")]


@app.callback()
def gateway(
    context: typer.Context,
    plc: Annotated[
        list[Path] | None, typer.Option("--plc", metavar="FILE", help="File of PLCs; may be given again.")
    ] = None,
    zenoh: ZenohOption = None,
    config: ConfigOption = None,
) -> None:
    """Poll PLCs over Modbus TCP and publish their samples on Zenoh."""
    if context.invoked_subcommand is not None:
        return
    settings = settings_of(config, zenoh)
    files = plc or settings.gateway.plcs
    if not files:
        raise ConfigError("gateway: give --plc FILE, or gateway.plcs in the settings")
    from wetwell.protocols.modbus.device_map import check_stations, load_plcs

    plcs = tuple(each for file in files for each in load_plcs(file))
    check_stations(plcs, ", ".join(map(str, files)))
    from wetwell.services.gateway.daemon import serve_gateway

    run(settings, serve_gateway(settings, plcs))


@app.command(cls=about("--plc"))
def check(file: PlcOption, as_json: JsonOption = False) -> None:
    """Check a file of PLCs, its maps and station files; show what would be read."""
    from wetwell.protocols.modbus.device_map import load_plcs

    plcs = load_plcs(file)
    from wetwell.services.gateway.survey import described

    print_result({plc.station: described(plc) for plc in plcs}, as_json=as_json)


@app.command(cls=about("--plc"))
def read(file: PlcOption, as_json: JsonOption = False) -> None:
    """Poll the PLCs of a file once and show values and words; exit code 1 if one does not answer."""
    import asyncio

    from wetwell.protocols.modbus.device_map import load_plcs

    plcs = load_plcs(file)
    from wetwell.services.gateway.survey import read_all

    results = asyncio.run(read_all(plcs))
    print_result(results, as_json=as_json)
    if any("error" in result for result in results.values() if isinstance(result, dict)):
        raise typer.Exit(1)
