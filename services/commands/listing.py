"""What there is: stations, settings, registers, effects, faults, schemas."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from wetwell.protocols.errors import ConfigError
from wetwell.services.commands.inputs import CommandGroup, about
from wetwell.services.commands.options import (
    ADMINISTER,
    AsStationOption,
    ConfigOption,
    JsonOption,
    StationOption,
    TimeZoneOption,
    print_result,
    reading_of,
    signals_named,
    there,
)

if TYPE_CHECKING:
    from pydantic import BaseModel

app = typer.Typer()
station_app = typer.Typer(cls=CommandGroup, no_args_is_help=True, help="Station files.")
config_app = typer.Typer(cls=CommandGroup, no_args_is_help=True, help="Settings of the services.")
app.add_typer(station_app, name="station", rich_help_panel=ADMINISTER)
effects_app = typer.Typer(cls=CommandGroup, help="Effects that a station file may name.")
app.add_typer(effects_app, name="effects", rich_help_panel=ADMINISTER)
app.add_typer(config_app, name="config", rich_help_panel=ADMINISTER)


@station_app.command("check", cls=about("--station"))
def station_check(station: StationOption, as_json: JsonOption = False) -> None:
    """Check a station file; says what is wrong with it, or nothing is."""
    from wetwell.services.reports.text_table import folded
    from wetwell.services.stations import find_station

    found = find_station(station)
    if as_json:
        print_result({"file": station, "station": found.name, "title": found.title, "is_valid": True}, as_json=True)
    else:
        titled = "" if found.title is None else f", {found.title},"
        typer.echo(folded(f"{station}: station '{found.name}'{titled} is valid"))


@station_app.command("show", cls=about("--station"))
def station_show(
    station: StationOption,
    signals: Annotated[
        str | None,
        typer.Option(
            "--signals", metavar="NAMES", help="Say what can be told apart by them: level, inflow, flow, head, power."
        ),
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

    plant = find_station(station)
    if signals is None and recording is None:
        return print_result(duty_table(plant), as_json=as_json)
    from wetwell.services.batch.isolability import isolability_of
    from wetwell.services.reports.isolability_table import isolability_table

    given = None if signals is None else signals_named(signals, "--signals")
    told = isolability_of(plant, given, recording, reading_of(time_zone, as_station=as_station))
    return print_result(isolability_table(plant, told, as_json=as_json), as_json=as_json)


@config_app.command("check", cls=about("--config"))
def config_check(
    config: Annotated[Path, typer.Option("--config", metavar="FILE", help="TOML file with settings.")],
    as_json: JsonOption = False,
) -> None:
    """Check a file with settings."""
    from wetwell.services.runtime.settings import load_settings

    load_settings(config)
    if as_json:
        print_result({"file": str(config), "is_valid": True}, as_json=True)
    else:
        typer.echo(f"{config}: settings are valid")


@config_app.command("show", cls=about("--config"))
def config_show(
    config: ConfigOption = None,
    as_json: JsonOption = True,  # noqa: ARG001 - they are printed as JSON whether or not it is asked for
) -> None:
    """Print the settings that are in force, as JSON."""
    from wetwell.services.runtime.settings import load_settings

    typer.echo(load_settings(config).model_dump_json(indent=2))


@app.command("modbus-map", cls=about("--station"), rich_help_panel=ADMINISTER)
def modbus_map(
    station: StationOption = "alpha",
    form: Annotated[Literal["csv", "json"], typer.Option("--format", help="Form of the map.")] = "csv",
    as_json: JsonOption = False,
) -> None:
    """Print the register map of a station's Modbus server."""
    from dataclasses import asdict

    from wetwell.protocols.modbus.registers import register_csv, register_table
    from wetwell.services.stations import find_station
    from wetwell.simulator.control.drivable import check_driven

    plant = find_station(station)
    try:
        check_driven(plant)
    except ValueError as error:
        raise ConfigError(str(error)) from error
    table = register_table(len(plant.pump), len(plant.control.start_levels_m))
    if as_json or form == "json":
        print_result({"registers": [asdict(register) for register in table]}, as_json=True)
    else:
        typer.echo(register_csv(table), nl=False)


@effects_app.callback(invoke_without_command=True)
def effects(context: typer.Context, *, as_json: JsonOption = False) -> None:
    """List the effects that a station file may name, with their parameters; or write a new one."""
    if context.invoked_subcommand is not None:
        return
    from wetwell.services.reports.part_tables import effect_lines
    from wetwell.simulator.effects import effect_table

    table = effect_table()
    if as_json:
        print_result({"effects": table}, as_json=True)
    else:
        typer.echo(effect_lines(table))


@effects_app.command("new")
def effects_new(
    diagnosis: Annotated[
        Path,
        typer.Option(
            "--from", metavar="DIR", help="Folder of a diagnosis that has taken a correction.", callback=there
        ),
    ],
    name: Annotated[str, typer.Option("--name", metavar="NAME", help="Of the effect, such as night_grease.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="For its source, its test and what else to do.")],
    as_json: JsonOption = False,
) -> None:
    """Write the files of a new effect from the correction of a diagnosis, for a person to finish."""
    from wetwell.services.batch.gap.new_effect import new_effect

    print_result(new_effect(diagnosis, name, out), as_json=as_json)


@app.command(rich_help_panel=ADMINISTER)
def faults(*, as_json: JsonOption = False) -> None:
    """List the faults that a scenario may name, with their parameters."""
    from wetwell.simulator.faults import FAULTS

    _print_parts("faults", FAULTS, as_json=as_json)


@app.command(rich_help_panel=ADMINISTER)
def inflows(*, as_json: JsonOption = False) -> None:
    """List the inflow models that a scenario may name, with their parameters."""
    from wetwell.simulator.inflow import INFLOWS

    _print_parts("inflows", INFLOWS, as_json=as_json)


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


def _print_parts(name: str, parts: Mapping[str, "type[BaseModel]"], *, as_json: bool) -> None:
    from wetwell.services.reports.part_tables import part_lines, part_table

    rows = part_table(parts)
    if as_json:
        print_result({name: rows}, as_json=True)
    else:
        typer.echo(part_lines(rows))
