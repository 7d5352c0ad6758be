"""What the commands share: options, settings from flags, how a result is printed."""

import os
import re
import sys
from collections.abc import Callable, Coroutine, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from wetwell.protocols.errors import ConfigError, RecordingError

if TYPE_CHECKING:
    from wetwell.protocols.orders import Step
    from wetwell.protocols.quantities import SensedQuantity
    from wetwell.protocols.recordings.reading import Reading
    from wetwell.protocols.station.station_file import Station
    from wetwell.protocols.station.table import Table
    from wetwell.services.runtime.settings import Settings
    from wetwell.simulator.scenario import Scenario
    from wetwell.simulator.simulation import Simulation

GROUPS = RUN, RECORD, JUDGE, GAP, OPERATE, ADMINISTER = "Run", "Record", "Judge", "Gap", "Operate", "Administer"
"""Groups of commands in `wetwell --help`, in this order."""


def built_in(kind: Literal["stations", "scenarios"]) -> Callable[[str], list[str]]:
    """Completion of a name that comes with the package; a shell offers files where none fits."""

    def names(incomplete: str) -> list[str]:
        from importlib.resources import files

        folder = files("wetwell.simulator") / kind
        found = sorted(file.name.removesuffix(".toml") for file in folder.iterdir() if file.name.endswith(".toml"))
        return [name for name in found if name.startswith(incomplete)]

    return names


def number(
    *names: str,
    low: float,
    high: float | None = None,
    help: str,  # noqa: A002 - as typer calls it
    metavar: str = "NUMBER",
) -> Any:
    """Option of a number of which the help says in words between what it must lie."""
    limits = f"at least {low:g}" if high is None else f"{low:g} to {high:g}"

    def checked(value: float | None) -> float | None:
        if value is not None and (value < low or (high is not None and value > high)):
            raise typer.BadParameter(f"got {value:g}, must be {limits}")
        return value

    return typer.Option(*names, callback=checked, metavar=metavar, help=f"{help.removesuffix('.')}; {limits}.")


StationOption = Annotated[
    str,
    typer.Option(
        "--station",
        metavar="FILE",
        help="Station file, or the name of a built-in station.",
        autocompletion=built_in("stations"),
    ),
]
StationNameOption = Annotated[
    str, typer.Option("--station", metavar="NAME", help="Name of the station, or its station file.")
]
ScenarioOption = Annotated[
    str,
    typer.Option(
        "--scenario",
        metavar="NAME",
        help="Built-in scenario, or a scenario file.",
        autocompletion=built_in("scenarios"),
    ),
]
SeedOption = Annotated[int, number(low=0, metavar="SEED", help="Same seed, same numbers.")]
SpeedOption = Annotated[
    float | None,
    typer.Option(metavar="NUMBER", help="Seconds of the station in a second on the wall; default: the scenario's."),
]
ConfigOption = Annotated[Path | None, typer.Option("--config", metavar="FILE", help="TOML file with settings.")]
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


def there(path: Path) -> Path:
    """Refuse a file or folder that is not there, before what would read it is loaded."""
    try:
        path.stat()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error
    return path


def names_apart(names: list[str] | None) -> list[str] | None:
    """Names of an option that takes several: with commas, or by giving it again.

    Examples
    --------
    >>> names_apart(["pump_wear, friction_bias", "motor_slip"])
    ['pump_wear', 'friction_bias', 'motor_slip']
    """
    return [name for text in names for name in listed(text)] if names else None


def listed(text: str) -> list[str]:
    """Names in a list with commas, which may be empty."""
    return [name.strip() for name in text.split(",") if name.strip()]


def all_there(paths: list[Path] | None) -> list[Path] | None:
    """Refuse files of which one is not there."""
    return None if paths is None else [there(path) for path in paths]


RecordingOption = Annotated[
    Path, typer.Option("--recording", metavar="FILE", help="CSV, CSV.gz or Parquet.", callback=there)
]
TimeZoneOption = Annotated[
    str | None, typer.Option("--time-zone", metavar="ZONE", help="Of stamps that have none, such as Europe/Helsinki.")
]
AsStationOption = Annotated[
    bool, typer.Option("--as-station", help="Take the recording for one of this station, whatever name it carries.")
]
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
) -> "Settings":
    """Settings from file, environment and flags."""
    from wetwell.services.runtime.settings import load_settings

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


def with_data(settings: "Settings", data: Path | None, otherwise: Path) -> "Settings":
    """Settings whose daemons keep all they know in `data`, or, where nothing says where, in `otherwise`."""
    from wetwell.services.runtime.settings import HistorianSettings

    folder = data or otherwise
    if data is not None or settings.historian == HistorianSettings():
        settings = with_history(settings, folder)
    changes: dict[str, Table] = {}
    for section in ("detector", "alarms", "watch"):
        table = getattr(settings, section)
        if data is not None or table.state_dir is None:
            changes[section] = table.model_copy(update={"state_dir": folder / section})
    if data is not None or settings.security.audit_dir is None:
        changes["security"] = settings.security.model_copy(update={"audit_dir": folder / "audit"})
    return settings.model_copy(update=changes)


def with_history(settings: "Settings", folder: Path | None) -> "Settings":
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


def plant_of(
    station: str, scenario: "Scenario", seed: int, start_ns: int, steps: Sequence["Step"] = ()
) -> "Simulation":
    """Simulation of a scenario on a station that can run it, and of what an operator does there."""
    from wetwell.services.stations import find_station

    plant = find_station(station)
    from wetwell.simulator.simulation import Simulation

    try:
        return Simulation(plant, scenario, seed, start_ns, steps)
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


def stamp_of(text: str, option: str) -> int:
    """Nanoseconds since 1970 of a stamp that an option gives."""
    from wetwell.protocols.timestamps import from_iso

    try:
        return from_iso(text)
    except ValueError as error:
        raise ConfigError(f"{option}: got {text!r}, must be ISO 8601 such as 2025-01-31T06:00:00Z") from error


def reading_of(time_zone: str | None, *, as_station: bool) -> "Reading":
    """How a recording is taken up, as flags say."""
    from wetwell.protocols.recordings.reading import Reading

    return Reading.said(time_zone, as_station=as_station)


def station_if(name: str | None) -> "Station | None":
    """Station of this name or file, if one is given."""
    if name is None:
        return None
    from wetwell.services.stations import find_station

    return find_station(name)


def station_name(name_or_file: str) -> str:
    """Name of a station, which may be given by its station file.

    Examples
    --------
    >>> station_name("north")
    'north'
    """
    return station_and_names(name_or_file)[0]


def station_and_names(name_or_file: str) -> tuple[str, str | None, tuple[str, ...]]:
    """Name of a station, and what people call it and its pumps; a name alone does not tell that."""
    if not name_or_file.endswith(".toml"):
        return name_or_file, None, ()
    from wetwell.protocols.station.station_file import load_station

    station = load_station(Path(name_or_file))
    return station.name, station.title, station.pump_labels


def signals_named(text: str, flag: str) -> tuple["SensedQuantity", ...]:
    """Quantities of signals in a list with commas, which may be empty.

    Raises
    ------
    ConfigError
        If one is not known.

    Examples
    --------
    >>> signals_named("head, flow", "--signals")
    ('flow_m3h', 'head_m')
    """
    from wetwell.protocols.quantities import SIGNALS

    named = listed(text)
    if unknown := [name for name in named if name not in SIGNALS]:
        raise ConfigError(f"{flag}: got '{unknown[0]}', must be of {', '.join(SIGNALS)}")
    return tuple(quantity for name, quantity in SIGNALS.items() if name in named)


def cores() -> int:
    """Processes at once where no flag says how many."""
    return os.cpu_count() or 1


def positive(value: float, flag: str) -> float:
    """The value of a flag that must be positive."""
    if not 0.0 < value < float("inf"):
        raise ConfigError(f"{flag}: got {value:g}, must be positive")
    return value


def run(settings: "Settings", daemon: Coroutine[Any, Any, None]) -> None:
    """Run a service until it ends, with its logs on standard error and its health page if the settings ask for it."""
    import asyncio
    import contextlib

    from wetwell.services.runtime.health.board import BOARD
    from wetwell.services.runtime.health.page import health_page
    from wetwell.services.runtime.logs import start_logging
    from wetwell.services.runtime.start import written_down

    service = sys.argv[1] if len(sys.argv) > 1 else "wetwell"
    start_logging(settings.log, service)
    with contextlib.closing(daemon), written_down(settings, service), health_page(settings.health, BOARD):
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
