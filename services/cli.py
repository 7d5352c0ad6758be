"""The command `wetwell`: parses and calls, nothing else."""

import asyncio
import os
import re
import sys
from collections.abc import Coroutine, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NoReturn, cast

import typer

from wetwell.protocols.errors import ConfigError, WetwellError
from wetwell.services.settings import LogSettings, Settings, load_settings

if TYPE_CHECKING:
    from pydantic import BaseModel

    from wetwell.simulator.scenario import Scenario
    from wetwell.simulator.simulation import Simulation

app = typer.Typer(
    name="wetwell",
    help="Watches wastewater pump stations and says whether a pump or the rising main is at fault.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
station_app = typer.Typer(no_args_is_help=True, help="Station files.")
config_app = typer.Typer(no_args_is_help=True, help="Settings of the services.")
app.add_typer(station_app, name="station")
app.add_typer(config_app, name="config")
gap_app = typer.Typer(no_args_is_help=True, help="The gap between simulation and reality.")
app.add_typer(gap_app, name="gap")

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
WordOrderOption = Annotated[
    Literal["ABCD", "CDAB"] | None, typer.Option("--word-order", help="Word order of 32-bit values on Modbus.")
]
RecordingOption = Annotated[Path, typer.Option("--recording", metavar="FILE", help="CSV, CSV.gz or Parquet.")]
PreparationOption = Annotated[
    Path | None, typer.Option("--preparation", metavar="FILE", help="TOML file: scale, offset, max_gap_s.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


@app.command()
def up(
    station: StationOption = "alpha",
    scenario: ScenarioOption = "demo",
    seed: SeedOption = 1,
    speed: SpeedOption = None,
    limit: Annotated[
        str | None, typer.Option("--for", metavar="TIME", help="Stop after this time on the wall: 90s, 10m, 2h.")
    ] = None,
    zenoh: ZenohOption = None,
    modbus: ModbusOption = None,
    word_order: WordOrderOption = None,
    config: ConfigOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print every verdict as a JSON line.")] = False,
) -> None:
    """Run the whole service on this machine: simulated station, Modbus, Zenoh, detector."""
    from wetwell.services.supervisor import serve_all
    from wetwell.services.terminal import banner, line_printer

    settings = _settings(config, zenoh, modbus, word_order)
    if settings.log == LogSettings():
        settings = settings.model_copy(update={"log": LogSettings(level="WARNING")})  # the verdicts are the news here
    limit_s = None if limit is None else parse_duration_s(limit)
    plant, speed = _live_plant(station, scenario, seed, speed)  # what is wrong is said here, not by a child
    if not as_json:
        typer.echo(banner(settings, plant.station, plant.scenario.name, speed))
    live = [
        "--station",
        station,
        "--scenario",
        scenario,
        "--seed",
        str(seed),
        "--speed",
        str(speed),
        "--modbus-server",
    ]
    commands = {"detector": ["detector", "--station", station], "simulator": ["simulator", *live]}
    _run(settings, serve_all(settings, plant.station.name, commands, line_printer(as_json=as_json), limit_s))


@app.command()
def simulator(
    station: StationOption = "alpha",
    scenario: ScenarioOption = "nominal",
    seed: SeedOption = 1,
    speed: SpeedOption = None,
    modbus_server: Annotated[
        bool, typer.Option("--modbus-server", help="Also serve the same plant on Modbus TCP.")
    ] = False,
    zenoh: ZenohOption = None,
    modbus: ModbusOption = None,
    word_order: WordOrderOption = None,
    config: ConfigOption = None,
) -> None:
    """Simulate a station live and publish its samples on Zenoh."""
    _serve_plant(
        _settings(config, zenoh, modbus, word_order), station, scenario, seed, speed, zenoh=True, modbus=modbus_server
    )


@app.command()
def plc(
    station: StationOption = "alpha",
    scenario: ScenarioOption = "nominal",
    seed: SeedOption = 1,
    speed: SpeedOption = None,
    modbus: ModbusOption = None,
    word_order: WordOrderOption = None,
    config: ConfigOption = None,
) -> None:
    """Simulate a station live behind a Modbus TCP server, as its PLC would show it; needs no Zenoh."""
    _serve_plant(
        _settings(config, None, modbus, word_order), station, scenario, seed, speed, zenoh=False, modbus=True
    )


detector_app = typer.Typer(invoke_without_command=True)
app.add_typer(detector_app, name="detector")


@detector_app.callback()
def detector(
    context: typer.Context,
    station: StationOption = "alpha",
    zenoh: ZenohOption = None,
    config: ConfigOption = None,
) -> None:
    """Judge the samples of a station on Zenoh and publish verdicts."""
    if context.invoked_subcommand is not None:
        return
    from wetwell.services.detector import serve_detector
    from wetwell.services.presets import find_station

    settings = _settings(config, zenoh)
    _run(settings, serve_detector(settings, find_station(station)))


@detector_app.command()
def rebaseline(
    pump: Annotated[int, typer.Option(min=1, help="Pump, from 1.")],
    by: Annotated[str, typer.Option(help="Who orders it; kept in the log and in the verdict.")],
    station: StationOption = "alpha",
    revert: Annotated[bool, typer.Option("--revert", help="Take the baseline back that was put aside last.")] = False,
    zenoh: ZenohOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Order a running detector to learn a pump anew, after a repair; what it knew is put aside."""
    from wetwell.services.orders import send_order
    from wetwell.services.presets import find_station

    name = find_station(station).name
    settings = _settings(config, zenoh)
    verdict = asyncio.run(send_order(settings, name, pump, "revert" if revert else "rebaseline", by))
    answer = {"station": name, "pump": pump, "state": verdict.state, "reason": verdict.evidence.get("reason")}
    _print(answer | {"baseline": verdict.evidence.get("baseline")}, as_json=as_json)


@app.command()
def replay(
    recording: Annotated[Path, typer.Option("--recording", help="CSV, CSV.gz or Parquet.")],
    station: StationOption = "alpha",
    speed: Annotated[float, typer.Option(help="How many times as fast as it was recorded.")] = 1.0,
    zenoh: ZenohOption = None,
    config: ConfigOption = None,
) -> None:
    """Publish a recording on Zenoh as if it were live, then end."""
    from wetwell.protocols.recording import read_recording
    from wetwell.services.presets import find_station
    from wetwell.services.replay import serve_replay

    settings = _settings(config, zenoh)
    rows = read_recording(recording)
    _run(settings, serve_replay(settings, rows, find_station(station).name, _positive(speed, "--speed")))


@app.command()
def router(zenoh: ZenohOption = None, config: ConfigOption = None) -> None:
    """Run a Zenoh router, for sites that have none."""
    from wetwell.services.router import serve_router

    settings = _settings(config, zenoh)
    _run(settings, serve_router(settings))


@app.command()
def simulate(
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="CSV, CSV.gz or Parquet.")],
    station: StationOption = "alpha",
    scenario: ScenarioOption = "nominal",
    days: Annotated[float | None, typer.Option(help="Length; default: the scenario's.")] = None,
    seed: SeedOption = 1,
    as_json: JsonOption = False,
) -> None:
    """Write a simulated recording, with truth columns."""
    from wetwell.services.batch import simulate as write
    from wetwell.services.presets import find_scenario
    from wetwell.simulator.scenario import DEFAULT_START_NS

    plant = _plant(station, find_scenario(scenario), seed, DEFAULT_START_NS)
    length_s = plant.scenario.duration_s if days is None else _positive(days, "--days") * 86_400.0
    rows = write(plant, max(round(length_s), 1), out)
    summary = {"recording": str(out), "rows": rows, "station": plant.station.name, "seed": seed}
    _print(summary, as_json=as_json)


@app.command()
def detect(
    recording: Annotated[Path, typer.Option("--recording", help="CSV, CSV.gz or Parquet.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="Verdicts, one JSON object a line.")],
    station: StationOption = "alpha",
    as_json: JsonOption = False,
) -> None:
    """Judge a recording with the streaming detector."""
    from wetwell.protocols.recording import read_recording
    from wetwell.services.batch import detect as judge
    from wetwell.services.presets import find_station

    plant = find_station(station)
    rows = read_recording(recording)
    for name in rows.ignored:
        typer.echo(f"{recording}: column '{name}' is not known and is ignored", err=True)
    _print(judge(plant, rows, out), as_json=as_json)


@app.command()
def backtest(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for backtest.json and backtest.html.")],
    station: StationOption = "alpha",
    recording: Annotated[
        list[Path] | None, typer.Option("--recording", metavar="FILE", help="With truth columns; may be given again.")
    ] = None,
    scenario: Annotated[
        list[str] | None, typer.Option("--scenario", metavar="NAME", help="To simulate; may be given again.")
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Number of seeds of each scenario.")] = 1,
    first_seed: Annotated[int, typer.Option("--first-seed", min=0, help="The first of them.")] = 1,
    days: Annotated[float | None, typer.Option(help="Length of each; default: the scenario's.")] = None,
    dataset: Annotated[
        Path | None, typer.Option("--dataset", metavar="DIR", help="Folder that `wetwell dataset` has made.")
    ] = None,
    detectors: Annotated[
        str, typer.Option(metavar="NAMES", help="With commas between; `all` for every one.")
    ] = "wetwell,paper_f_test,paper_tangent,paper_f_shift,paper_tangent_segments",
    learning_h: Annotated[
        float, typer.Option("--learning-h", min=0.0, help="Runs that end in these first hours are not scored.")
    ] = 6.0,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; default: as many as cores.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Score verdicts against truth: ours, the paper's two methods, their best readings and outside detectors."""
    from wetwell.services.backtest import detector_names, overview, run_backtest, sources_of, write_backtest
    from wetwell.services.presets import find_scenario, find_station

    names = detector_names(detectors)
    length_s = None if days is None else max(round(_positive(days, "--days") * 86_400.0), 1)
    plans = [find_scenario(name) for name in scenario or []]
    sources = sources_of(
        find_station(station), recording or [], plans, range(first_seed, first_seed + seeds), length_s, dataset
    )
    result = run_backtest(sources, names, min(workers or os.cpu_count() or 1, len(sources)), learning_h * 3600.0)
    write_backtest(result, out)
    _print(result if as_json else overview(result), as_json=as_json)


@app.command()
def prepare(
    recording: RecordingOption,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="CSV, CSV.gz or Parquet.")],
    preparation: PreparationOption = None,
    as_json: JsonOption = False,
) -> None:
    """Prepare a recording from the field: units, offsets, order, doubles; list its gaps."""
    from wetwell.services.field_data import prepare_file

    _print(prepare_file(recording, preparation, out), as_json=as_json)


@app.command()
def calibrate(
    recording: RecordingOption,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="Station file that is written.")],
    station: StationOption = "alpha",
    preparation: PreparationOption = None,
    as_json: JsonOption = False,
) -> None:
    """Fit a station file to a recording, with intervals; says what the recording cannot tell."""
    from wetwell.services.field_data import calibrate_file
    from wetwell.services.presets import find_station

    _print(calibrate_file(find_station(station), recording, preparation, out), as_json=as_json)


@app.command()
def validate(
    recording: RecordingOption,
    station: StationOption = "alpha",
    preparation: PreparationOption = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Simulated recording that is written.")
    ] = None,
    html: Annotated[
        Path | None, typer.Option("--html", metavar="FILE", help="Page with plots that is written; needs no network.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Run the simulator under the inflow of a recording and compare level, starts and run time."""
    from wetwell.services.field_data import validate_file
    from wetwell.services.presets import find_station

    _print(validate_file(find_station(station), recording, preparation, out, html), as_json=as_json)


@app.command()
def convert(
    source: Annotated[Path, typer.Argument(help="File in a foreign form.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="CSV, CSV.gz or Parquet.")],
    form: Annotated[Literal["skab"], typer.Option("--from", help="Form of the file.")] = "skab",
    as_json: JsonOption = False,
) -> None:
    """Turn a file of another origin into a recording."""
    from wetwell.protocols.importers import IMPORTERS
    from wetwell.protocols.recording import write_recording

    recording = IMPORTERS[form](source)
    write_recording(recording, out)
    _print({"recording": str(out), "rows": len(recording), "columns": sorted(recording.columns)}, as_json=as_json)


@app.command()
def dataset(
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder that is made or completed.")
    ] = None,
    count: Annotated[int, typer.Option(min=1, help="Number of recordings.")] = 100,
    seed: SeedOption = 1,
    station: Annotated[
        list[str] | None, typer.Option("--station", metavar="FILE", help="Base station; may be given again.")
    ] = None,
    days: Annotated[float, typer.Option(help="Length of each recording.")] = 1.0,
    form: Annotated[
        Literal["parquet", "csv.gz"], typer.Option("--format", help="Form of the recordings.")
    ] = "parquet",
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; default: as many as cores.")] = None,
    check: Annotated[
        Path | None, typer.Option("--check", metavar="DIR", help="Make nothing: verify the checksums of a dataset.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Make a balanced, labelled set of recordings over sampled stations and faults; run again to resume."""
    from wetwell.services.dataset import check_dataset, make_dataset, plan_of
    from wetwell.services.presets import find_station

    if (out is None) == (check is None):
        raise ConfigError("dataset: give either --out DIR or --check DIR")
    if check is not None:
        return _print(check_dataset(check), as_json=as_json)
    bases = [find_station(name) for name in station or ["alpha"]]
    plan = plan_of(bases, seed, count, _positive(days, "--days"), form)
    processes = min(workers or os.cpu_count() or 1, count)
    return _print(make_dataset(plan, cast("Path", out), processes), as_json=as_json)


@app.command()
def kpi(recording: RecordingOption, as_json: JsonOption = False) -> None:
    """Print energy, starts, run time and volume of a recording, by day and in total."""
    from wetwell.protocols.recording import read_recording
    from wetwell.services.terminal import kpi_table
    from wetwell.simulator.kpi import kpis

    _print(kpi_table(kpis(read_recording(recording)), with_hours=as_json), as_json=as_json)


@gap_app.command("trial")
def gap_trial(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder that is made or completed.")],
    seed: SeedOption = 1,
    cases: Annotated[int, typer.Option(min=1, help="Number of sealed cases.")] = 50,
    plant: Annotated[Literal["fine", "swmm", "both"], typer.Option(help="What stands for reality.")] = "fine",
    kinds: Annotated[
        str, typer.Option(help="Of single, pair, none, open, leave_one_out; with commas.")
    ] = "single,pair,none,open,leave_one_out",
    days: Annotated[float, typer.Option(help="Length of each recording.")] = 1.0,
    workers: Annotated[int, typer.Option(min=1, help="Diagnoses at once.")] = 1,
    recalibration: Annotated[
        bool, typer.Option("--recalibration", help="Diagnose each case once more by recalibration only.")
    ] = False,
    unseen: Annotated[
        bool, typer.Option("--unseen", help="Measure the shrinkage on recordings that no diagnosis has seen.")
    ] = False,
    diagnoser: Annotated[
        str | None, typer.Option("--diagnoser", metavar="COMMAND", help="In place of wetwell gap diagnose.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Check the diagnosis on sealed recordings of other plants; run again to resume."""
    import shlex

    from wetwell.services.trial import DIAGNOSE, REPLAY, TrialPlan, brief, parse_kinds, run_trial

    plan = TrialPlan(
        seed=seed,
        count=cases,
        kinds=parse_kinds(kinds),
        plants=("fine", "swmm") if plant == "both" else (plant,),
        seconds=round(_positive(days, "--days") * 86_400.0),
        command=DIAGNOSE if diagnoser is None else tuple(shlex.split(diagnoser)),
        replay=REPLAY if unseen else (),
        has_recalibration=recalibration,
    )
    result = run_trial(plan, out, workers)
    _print(result if as_json else brief(result, out), as_json=as_json)


@app.command("modbus-map")
def modbus_map(
    station: StationOption = "alpha",
    form: Annotated[Literal["csv"], typer.Option("--format", help="Form of the map.")] = "csv",  # noqa: ARG001
) -> None:
    """Print the register map of a station's Modbus server."""
    from wetwell.protocols.registers import register_csv, register_table
    from wetwell.services.presets import find_station

    plant = find_station(station)
    typer.echo(register_csv(register_table(len(plant.pump), len(plant.control.start_levels_m))), nl=False)


@app.command()
def effects(*, as_json: JsonOption = False) -> None:
    """List the effects that a station file may name, with their parameters."""
    from wetwell.services.terminal import effect_lines
    from wetwell.simulator.effects import effect_table

    table = effect_table()
    if as_json:
        _print({"effects": table}, as_json=True)
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


@station_app.command("check")
def station_check(file: Annotated[str, typer.Argument(help="Station file.")]) -> None:
    """Check a station file; says what is wrong with it, or nothing is."""
    from wetwell.services.presets import find_station

    typer.echo(f"{file}: station '{find_station(file).name}' is valid")


@station_app.command("show")
def station_show(
    file: Annotated[str, typer.Argument(help="Station file.")] = "alpha", as_json: JsonOption = False
) -> None:
    """Print the duty points of a station, for each pump alone and for all together."""
    from wetwell.services.presets import find_station
    from wetwell.simulator.duty import duty_table

    _print(duty_table(find_station(file)), as_json=as_json)


@config_app.command("check")
def config_check(file: Annotated[Path, typer.Argument(help="TOML file with settings.")]) -> None:
    """Check a file with settings."""
    load_settings(file)
    typer.echo(f"{file}: settings are valid")


@config_app.command("show")
def config_show(config: ConfigOption = None) -> None:
    """Print the settings that are in force, as JSON."""
    typer.echo(load_settings(config).model_dump_json(indent=2))


@gap_app.command("diagnose")
def gap_diagnose(
    recording: RecordingOption,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for report and station file.")],
    station: StationOption = "alpha",
    without: Annotated[
        list[str] | None, typer.Option("--without", metavar="NAME", help="Leave this effect out; may be given again.")
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="NAME", help="Try only this effect; may be given again.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Say where a recording departs from the simulator, which effect causes it, and how far that closes the gap."""
    from wetwell.services.gap import diagnose_file
    from wetwell.services.gap_terminal import gap_lines, progress_bar
    from wetwell.services.presets import find_station

    plant = find_station(station)
    with progress_bar("diagnosis") as progress:
        report = diagnose_file(plant, recording, out, only=only, without=without or (), progress=progress)
    typer.echo(report.model_dump_json(by_alias=True, indent=2) if as_json else gap_lines(report, out))


@gap_app.command("replay")
def gap_replay(
    recording: RecordingOption,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="CSV, CSV.gz or Parquet.")],
    station: StationOption = "alpha",
    closed_loop: Annotated[
        bool,
        typer.Option("--closed-loop", help="Take only the inflow from the recording, not frequencies and level."),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Write what the simulator says for a recording, second by second."""
    from wetwell.services.gap import replay_file
    from wetwell.services.presets import find_station

    _print(replay_file(find_station(station), recording, out, closed_loop=closed_loop), as_json=as_json)


def parse_duration_s(text: str) -> float:
    """Seconds in a text such as 90, 90s, 10m or 2h.

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
        raise ConfigError(f"--for: got '{text}', must be a time such as 90s, 10m or 2h")
    return float(match[1]) * {"": 1.0, "s": 1.0, "m": 60.0, "h": 3600.0}[match[2]]


def _settings(
    config: Path | None,
    zenoh: str | None = None,
    modbus: str | None = None,
    word_order: Literal["ABCD", "CDAB"] | None = None,
) -> Settings:
    flags: dict[str, Any] = {}
    if zenoh is not None:
        flags["zenoh"] = {"endpoint": zenoh}
    if modbus is not None:
        host, colon, port = modbus.rpartition(":")
        if not colon or not port.isdecimal():
            raise ConfigError(f"--modbus: got '{modbus}', must be HOST:PORT such as 127.0.0.1:5020")
        flags["modbus"] = {"host": host, "port": int(port)}
    if word_order is not None:
        flags.setdefault("modbus", {})["word_order"] = word_order
    return load_settings(config, flags)


def _plant(station: str, scenario: "Scenario", seed: int, start_ns: int) -> "Simulation":
    """Simulation of a scenario on a station that can run it."""
    from wetwell.services.presets import find_station
    from wetwell.simulator.simulation import Simulation

    try:
        return Simulation(find_station(station), scenario, seed, start_ns)
    except ValueError as error:
        raise ConfigError(str(error)) from error


def _live_plant(station: str, scenario: str, seed: int, speed: float | None) -> tuple["Simulation", float]:
    """Simulation and its speed; at the speed of life it starts now, else at a fixed date."""
    from wetwell.services.clock import this_second_ns
    from wetwell.services.presets import find_scenario
    from wetwell.simulator.scenario import DEFAULT_START_NS

    plan = find_scenario(scenario)
    speed = plan.clock_speed if speed is None else _positive(speed, "--speed")
    return _plant(station, plan, seed, this_second_ns() if speed == 1.0 else DEFAULT_START_NS), speed


def _serve_plant(
    settings: Settings, station: str, scenario: str, seed: int, speed: float | None, *, zenoh: bool, modbus: bool
) -> None:
    from wetwell.services.simulator import serve_simulator

    plant, speed = _live_plant(station, scenario, seed, speed)
    _run(settings, serve_simulator(settings, plant, speed, zenoh=zenoh, modbus=modbus))


def _positive(value: float, flag: str) -> float:
    if not 0.0 < value < float("inf"):
        raise ConfigError(f"{flag}: got {value:g}, must be positive")
    return value


def _run(settings: Settings, service: Coroutine[Any, Any, None]) -> None:
    from wetwell.services.daemon import start_logging

    start_logging(settings.log.level)
    asyncio.run(service)


def _print(result: dict[str, object], *, as_json: bool) -> None:
    from wetwell.services.terminal import as_json as to_json
    from wetwell.services.terminal import as_lines

    typer.echo(to_json(result) if as_json else as_lines(result))


def _print_parts(name: str, parts: Mapping[str, "type[BaseModel]"], *, as_json: bool) -> None:
    from wetwell.services.listing import part_lines, part_table

    rows = part_table(parts)
    if as_json:
        _print({name: rows}, as_json=True)
    else:
        typer.echo(part_lines(rows))


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
