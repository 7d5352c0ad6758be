"""Services that run until they are stopped."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from wetwell.services.commands.inputs import CommandGroup, about
from wetwell.services.commands.options import (
    RUN,
    AsStationOption,
    ConfigOption,
    JsonOption,
    ModbusOption,
    PageOption,
    RecordingOption,
    ScenarioOption,
    SeedOption,
    SpeedOption,
    StationNameOption,
    StationOption,
    TimeZoneOption,
    WordOrderOption,
    ZenohOption,
    live_plant,
    number,
    parse_duration_s,
    positive,
    print_result,
    reading_of,
    run,
    settings_of,
    station_name,
    with_data,
)

app = typer.Typer()


@app.command(cls=about("--station"), rich_help_panel=RUN)
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
    page: PageOption = None,
    config: ConfigOption = None,
    data: Annotated[
        Path | None,
        typer.Option("--data", metavar="DIR", help="Where all is kept; default: gone at the end."),
    ] = None,
    steady: Annotated[
        bool,
        typer.Option(
            "--steady", help="Run at one speed: do not slow down at changes of state, or stand at the scenario's end."
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print every verdict as a JSON line.")] = False,
) -> None:
    """Run all on this machine: simulated station, Modbus, Zenoh, detector, historian, alarms, watch, page."""
    import tempfile

    from wetwell.services.runtime.settings import LogSettings

    settings = settings_of(config, zenoh, modbus, word_order, page=page)
    if settings.log == LogSettings():
        settings = settings.model_copy(update={"log": LogSettings(level="WARNING")})  # the verdicts are the news here
    limit_s = None if limit is None else parse_duration_s(limit)
    is_shown = speed is None and not steady
    plant, speed = live_plant(station, scenario, seed, speed)  # what is wrong is said here, not by a child
    from wetwell.services.reports.terminal import banner
    from wetwell.services.reports.text_table import folded
    from wetwell.services.supervisor.runs import RunRecord, take_folder
    from wetwell.services.supervisor.screens import JsonScreen, TerminalScreen
    from wetwell.services.supervisor.serve import Screen, UpPlan, serve_all

    is_shown = is_shown and speed > 1.0
    begin_s, words = 0, ""
    if data is not None:
        taken = take_folder(data, RunRecord.of(plant, seed, is_life=speed == 1.0))
        data, begin_s, words = taken.path, taken.begin_s, taken.words
    live = ["--station", station, "--scenario", scenario, "--seed", str(seed), "--speed", str(speed)]
    live += ["--modbus-server", "--held", "--begin", str(begin_s)]
    commands = {
        "historian": ["historian"],
        "dashboard": ["dashboard"],
        "detector": ["detector", "--station", station],
        "alarms": ["alarms", "--station", station, "--held"],
        "watch": ["gap", "watch", "--station", station],
        "simulator": ["simulator", *live, *(["--stand-at-end"] if is_shown else [])],
    }
    with tempfile.TemporaryDirectory(prefix="wetwell-") as folder:
        settings = with_data(settings, data, Path(folder))
        text = banner(settings, plant.station, plant.scenario.name, speed)
        text += folded(f"\nData in {words}") + "\n" if words else ""
        screen: Screen = JsonScreen(_say) if as_json else TerminalScreen(_say, text, plant.station.pump_labels)
        story_s = plant.scenario.duration_s
        plan = UpPlan(plant.station.name, commands, is_shown=is_shown, story_s=story_s, limit_s=limit_s)
        run(settings, serve_all(settings, plan, screen))


def _say(text: str, ends: bool) -> None:
    typer.echo(text, nl=ends)
    sys.stdout.flush()


@app.command(cls=about("--station"), rich_help_panel=RUN)
def simulator(
    station: StationOption = "alpha",
    scenario: ScenarioOption = "nominal",
    seed: SeedOption = 1,
    speed: SpeedOption = None,
    modbus_server: Annotated[
        bool, typer.Option("--modbus-server", help="Also serve the same plant on Modbus TCP.")
    ] = False,
    held: Annotated[bool, typer.Option("--held", help="Let the plant stand until an order lets it go.")] = False,
    begin: Annotated[
        int, number(low=0, metavar="SECONDS", help="So many seconds were told before: begin behind them.")
    ] = 0,
    stand_at_end: Annotated[
        bool, typer.Option("--stand-at-end", help="Let the plant stand where its scenario ends.")
    ] = False,
    zenoh: ZenohOption = None,
    modbus: ModbusOption = None,
    word_order: WordOrderOption = None,
    config: ConfigOption = None,
) -> None:
    """Simulate a station live and publish its samples on Zenoh."""
    settings = settings_of(config, zenoh, modbus, word_order)
    plant, speed = live_plant(station, scenario, seed, speed)
    from wetwell.services.simulator.daemon import PlantStart, serve_simulator

    start = PlantStart(begin, is_held=held, stands_at_end=stand_at_end)
    run(settings, serve_simulator(settings, plant, speed, start, zenoh=True, modbus=modbus_server))


@app.command(cls=about("--station"), rich_help_panel=RUN)
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
    settings = settings_of(config, None, modbus, word_order)
    plant, speed = live_plant(station, scenario, seed, speed)
    from wetwell.services.simulator.daemon import PlantStart, serve_simulator

    run(settings, serve_simulator(settings, plant, speed, PlantStart(), zenoh=False, modbus=True))


detector_app = typer.Typer(cls=CommandGroup, invoke_without_command=True)
app.add_typer(detector_app, name="detector", rich_help_panel=RUN)


@detector_app.callback()
def detector(
    context: typer.Context,
    station: Annotated[
        list[str] | None,
        typer.Option("--station", metavar="FILE", help="Station file or built-in station; may be given again."),
    ] = None,
    zenoh: ZenohOption = None,
    config: ConfigOption = None,
) -> None:
    """Judge the samples of stations on Zenoh and publish verdicts."""
    if context.invoked_subcommand is not None:
        return
    from wetwell.services.stations import find_stations

    settings, stations = settings_of(config, zenoh), find_stations(station or ["alpha"])
    from wetwell.services.detector.daemon import serve_detector

    run(settings, serve_detector(settings, stations))


@detector_app.command()
def rebaseline(
    pump: Annotated[int, number(low=1, help="Pump, from 1.")],
    by: Annotated[str, typer.Option(metavar="NAME", help="Who orders it; kept in the log and in the verdict.")],
    station: StationOption = "alpha",
    revert: Annotated[bool, typer.Option("--revert", help="Take the baseline back that was put aside last.")] = False,
    zenoh: ZenohOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Order a running detector to learn a pump anew, after a repair; what it knew is put aside."""
    import asyncio

    from wetwell.services.stations import find_station

    settings, name = settings_of(config, zenoh), find_station(station).name
    from wetwell.services.detector.client import send_order

    verdict = asyncio.run(send_order(settings, name, pump, "revert" if revert else "rebaseline", by))
    answer = {"station": name, "pump": pump, "state": verdict.state, "reason": verdict.evidence.get("reason")}
    print_result(answer | {"baseline": verdict.evidence.get("baseline")}, as_json=as_json)


@detector_app.command(cls=about("--station"))
def release(
    station: StationNameOption,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Judge a station again, from the next start on, that was left out because the detector had crashed at it."""
    settings = settings_of(config)
    from wetwell.services.detector.quarantine import Quarantine
    from wetwell.services.runtime.clock import now_ns
    from wetwell.services.security.audit import audit_in
    from wetwell.services.security.tokens import user

    kept, name = settings.detector, station_name(station)
    audit_in(settings.security.audit_dir, "detector").write(now_ns(), act="release", by=user(), station=name)
    Quarantine(kept.state_dir, "release", kept.crash_tries, kept.crash_window_s).release(name)
    print_result({"station": name, "judged": "from the next start on"}, as_json=as_json)


@app.command(cls=about("--recording"), rich_help_panel=RUN)
def replay(
    recording: RecordingOption,
    station: StationOption,
    speed: Annotated[float, typer.Option(metavar="NUMBER", help="How many times as fast as it was recorded.")] = 1.0,
    as_station: AsStationOption = False,
    time_zone: TimeZoneOption = None,
    zenoh: ZenohOption = None,
    config: ConfigOption = None,
) -> None:
    """Publish a recording on Zenoh as if it were live, then end."""
    from wetwell.services.stations import find_station

    settings = settings_of(config, zenoh)
    plant = find_station(station)
    rows = reading_of(time_zone, as_station=as_station).read_of(recording, plant)
    from wetwell.services.replay.daemon import serve_replay

    run(settings, serve_replay(settings, rows, plant.name, positive(speed, "--speed")))


@app.command(rich_help_panel=RUN)
def router(zenoh: ZenohOption = None, config: ConfigOption = None) -> None:
    """Run a Zenoh router, for sites that have none."""
    settings = settings_of(config, zenoh)
    from wetwell.services.router.daemon import serve_router

    run(settings, serve_router(settings))
