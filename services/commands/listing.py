"""What there is: stations, settings, registers, effects, faults."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.recordings.reading import Reading
from wetwell.services.commands.options import (
    AsStationOption,
    ConfigOption,
    JsonOption,
    StationOption,
    TimeZoneOption,
    print_result,
    signals_named,
)
from wetwell.services.runtime.settings import load_settings

if TYPE_CHECKING:
    from pydantic import BaseModel

app = typer.Typer()
station_app = typer.Typer(no_args_is_help=True, help="Station files.")
config_app = typer.Typer(no_args_is_help=True, help="Settings of the services.")
app.add_typer(station_app, name="station")
app.add_typer(config_app, name="config")


@station_app.command("check")
def station_check(file: Annotated[str, typer.Argument(help="Station file.")]) -> None:
    """Check a station file; says what is wrong with it, or nothing is."""
    from wetwell.services.stations import find_station

    typer.echo(f"{file}: station '{find_station(file).name}' is valid")


@station_app.command("show")
def station_show(
    file: Annotated[str, typer.Argument(help="Station file, or the name of a built-in station.")],
    signals: Annotated[
        str | None,
        typer.Option("--signals", help="Say what can be told apart by them: level, inflow, flow, head, power."),
    ] = None,
    recording: Annotated[
        Path | None,
        typer.Option(
            "--recording", metavar="FILE", help="Say what can be told apart by its signals and duty points."
        ),
    ] = None,
    as_station: AsStationOption = False,
    time_zone: TimeZoneOption = None,
    as_json: JsonOption = False,
) -> None:
    """Print the duty points of a station, for each pump alone and for all together; or what can be told apart."""
    from wetwell.services.stations import find_station
    from wetwell.simulator.duty import duty_table

    station = find_station(file)
    if signals is None and recording is None:
        return print_result(duty_table(station), as_json=as_json)
    from wetwell.services.batch.isolability import isolability_of
    from wetwell.services.reports.isolability_table import isolability_table

    given = None if signals is None else signals_named(signals, "--signals")
    told = isolability_of(station, given, recording, Reading.said(time_zone, as_station=as_station))
    return print_result(isolability_table(station, told, as_json=as_json), as_json=as_json)


@config_app.command("check")
def config_check(file: Annotated[Path, typer.Argument(help="TOML file with settings.")]) -> None:
    """Check a file with settings."""
    load_settings(file)
    typer.echo(f"{file}: settings are valid")


@config_app.command("show")
def config_show(config: ConfigOption = None) -> None:
    """Print the settings that are in force, as JSON."""
    typer.echo(load_settings(config).model_dump_json(indent=2))


@app.command("modbus-map")
def modbus_map(
    station: StationOption = "alpha",
    form: Annotated[Literal["csv"], typer.Option("--format", help="Form of the map.")] = "csv",  # noqa: ARG001
) -> None:
    """Print the register map of a station's Modbus server."""
    from wetwell.protocols.modbus.registers import register_csv, register_table
    from wetwell.services.stations import find_station
    from wetwell.simulator.simulation import check_driven

    plant = find_station(station)
    try:
        check_driven(plant)
    except ValueError as error:
        raise ConfigError(str(error)) from error
    typer.echo(register_csv(register_table(len(plant.pump), len(plant.control.start_levels_m))), nl=False)


@app.command()
def effects(*, as_json: JsonOption = False) -> None:
    """List the effects that a station file may name, with their parameters."""
    from wetwell.services.reports.part_tables import effect_lines
    from wetwell.simulator.effects import effect_table

    table = effect_table()
    if as_json:
        print_result({"effects": table}, as_json=True)
    else:
        typer.echo(effect_lines(table))


@app.command()
def faults(*, as_json: JsonOption = False) -> None:
    """List the faults that a scenario may name, with their parameters."""
    from wetwell.simulator.faults import FAULTS

    _print_parts("faults", FAULTS, as_json=as_json)


@app.command()
def inflows(*, as_json: JsonOption = False) -> None:
    """List the inflow models that a scenario may name, with their parameters."""
    from wetwell.simulator.inflow import INFLOWS

    _print_parts("inflows", INFLOWS, as_json=as_json)


def _print_parts(name: str, parts: Mapping[str, "type[BaseModel]"], *, as_json: bool) -> None:
    from wetwell.services.reports.part_tables import part_lines, part_table

    rows = part_table(parts)
    if as_json:
        print_result({name: rows}, as_json=True)
    else:
        typer.echo(part_lines(rows))
