"""What the commands share: options, settings from flags, how a result is printed."""

import asyncio
import contextlib
import re
import sys
from collections.abc import Coroutine
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.station.table import Table
from wetwell.services.runtime.settings import HistorianSettings, Settings, load_settings

if TYPE_CHECKING:
    from wetwell.simulator.scenario import Scenario
    from wetwell.simulator.simulation import Simulation

StationOption = Annotated[
    str, typer.Option("--station", metavar="FILE", help="Station file, or the name of a built-in station.")
]
ScenarioOption = Annotated[
    str, typer.Option("--scenario", metavar="NAME", help="Built-in scenario, or a scenario file.")
]
SeedOption = Annotated[int, typer.Option(min=0, help="Same seed, same numbers.")]
SpeedOption = Annotated[
    float | None, typer.Option(help="Seconds of the station in a second on the wall; default: the scenario's.")
]
ConfigOption = Annotated[Path | None, typer.Option("--config", help="TOML file with settings.")]
ZenohOption = Annotated[str | None, typer.Option("--zenoh", metavar="ENDPOINT", help="Such as tcp/127.0.0.1:7447.")]
ModbusOption = Annotated[
    str | None, typer.Option("--modbus", metavar="HOST:PORT", help="Address of the Modbus TCP server.")
]
PageOption = Annotated[
    str | None, typer.Option("--page", metavar="HOST:PORT", help="Address of the control-room page.")
]
WordOrderOption = Annotated[
    Literal["ABCD", "CDAB"] | None, typer.Option("--word-order", help="Word order of 32-bit values on Modbus.")
]
RecordingOption = Annotated[Path, typer.Option("--recording", metavar="FILE", help="CSV, CSV.gz or Parquet.")]
PreparationOption = Annotated[
    Path | None, typer.Option("--preparation", metavar="FILE", help="TOML file: scale, offset, max_gap_s.")
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler", metavar="ADDRESS|local", help="Dask scheduler, tcp://HOST:8786; default: processes here."
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


def parse_duration_s(text: str, flag: str = "--for") -> float:
    """Seconds in a text such as 90, 90s, 10m or 2h; an error names the flag.

    Raises
    ------
    ConfigError
        If the text is none.

    Examples
    --------
    >>> parse_duration_s("90"), parse_duration_s("10m"), parse_duration_s("1.5h")
    (90.0, 600.0, 5400.0)
    """
    match = re.fullmatch(r"(\d+(?:\.\d+)?)([smh]?)", text)
    if match is None:
        raise ConfigError(f"{flag}: got '{text}', must be a time such as 90s, 10m or 2h")
    return float(match[1]) * {"": 1.0, "s": 1.0, "m": 60.0, "h": 3600.0}[match[2]]


def settings_of(
    config: Path | None,
    zenoh: str | None = None,
    modbus: str | None = None,
    word_order: Literal["ABCD", "CDAB"] | None = None,
    more: dict[str, Any] | None = None,
    page: str | None = None,
) -> Settings:
    """Settings from file, environment and flags."""
    flags: dict[str, Any] = dict(more or {})
    if zenoh is not None:
        flags["zenoh"] = {"endpoint": zenoh}
    if modbus is not None:
        flags["modbus"] = _address("--modbus", modbus, "127.0.0.1:5020")
    if page is not None:
        flags["dashboard"] = _address("--page", page, "127.0.0.1:8080")
    if word_order is not None:
        flags.setdefault("modbus", {})["word_order"] = word_order
    return load_settings(config, flags)


def with_data(settings: Settings, data: Path | None, otherwise: Path) -> Settings:
    """Settings whose daemons keep all they know in `data`, or, where nothing says where, in `otherwise`."""
    folder = data or otherwise
    if data is not None or settings.historian == HistorianSettings():
        settings = with_history(settings, folder)
    changes: dict[str, Table] = {}
    for section in ("detector", "alarms"):
        table = getattr(settings, section)
        if data is not None or table.state_dir is None:
            changes[section] = table.model_copy(update={"state_dir": folder / section})
    return settings.model_copy(update=changes)


def with_history(settings: Settings, folder: Path | None) -> Settings:
    """Settings with another folder of the history, if one is given."""
    if folder is None:
        return settings
    historian = settings.historian.model_copy(update={"folder": folder, "url": None})
    return settings.model_copy(update={"historian": historian})


def _address(flag: str, text: str, example: str) -> dict[str, Any]:
    host, colon, port = text.rpartition(":")
    if not colon or not port.isdecimal():
        raise ConfigError(f"{flag}: got '{text}', must be HOST:PORT such as {example}")
    return {"host": host.strip("[]"), "port": int(port)}


def plant_of(station: str, scenario: "Scenario", seed: int, start_ns: int) -> "Simulation":
    """Simulation of a scenario on a station that can run it."""
    from wetwell.services.stations import find_station
    from wetwell.simulator.simulation import Simulation

    try:
        return Simulation(find_station(station), scenario, seed, start_ns)
    except ValueError as error:
        raise ConfigError(str(error)) from error


def live_plant(station: str, scenario: str, seed: int, speed: float | None) -> tuple["Simulation", float]:
    """Simulation and its speed; at the speed of life it starts now, else at a fixed date."""
    from wetwell.services.runtime.clock import this_second_ns
    from wetwell.services.stations import find_scenario
    from wetwell.simulator.scenario import DEFAULT_START_NS

    plan = find_scenario(scenario)
    speed = plan.clock_speed if speed is None else positive(speed, "--speed")
    return plant_of(station, plan, seed, this_second_ns() if speed == 1.0 else DEFAULT_START_NS), speed


def positive(value: float, flag: str) -> float:
    """The value of a flag that must be positive."""
    if not 0.0 < value < float("inf"):
        raise ConfigError(f"{flag}: got {value:g}, must be positive")
    return value


def run(settings: Settings, daemon: Coroutine[Any, Any, None]) -> None:
    """Run a service until it ends, with its logs on standard error and its health page if the settings ask for it."""
    from wetwell.services.runtime.health.board import BOARD
    from wetwell.services.runtime.health.page import health_page
    from wetwell.services.runtime.logs import start_logging

    start_logging(settings.log, service=sys.argv[1] if len(sys.argv) > 1 else "wetwell")
    with contextlib.closing(daemon), health_page(settings.health, BOARD):
        asyncio.run(daemon)


def print_result(result: dict[str, object], *, as_json: bool) -> None:
    """Print a result, for people or as JSON."""
    from wetwell.services.reports.tables import as_json as to_json
    from wetwell.services.reports.tables import as_lines

    typer.echo(to_json(result) if as_json else as_lines(result))


def print_batch(result: dict[str, object], *, as_json: bool) -> None:
    """Print the result of a batch; exit code 1 if something of it has failed."""
    print_result(result, as_json=as_json)
    if result["failed"]:
        raise typer.Exit(1)
