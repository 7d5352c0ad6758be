"""Verdicts on recordings, and how good they are."""

from pathlib import Path
from typing import Annotated

import typer

from wetwell.protocols.errors import ConfigError
from wetwell.services.commands.inputs import about
from wetwell.services.commands.options import (
    JUDGE,
    AsStationOption,
    JsonOption,
    RecordingOption,
    SchedulerOption,
    StationOption,
    TimeZoneOption,
    all_there,
    cores,
    number,
    positive,
    print_batch,
    print_result,
    reading_of,
    settings_of,
    station_name,
    with_history,
)

app = typer.Typer()


@app.command(cls=about("--recording"), rich_help_panel=JUDGE)
def detect(
    recording: RecordingOption,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="Verdicts, one JSON object a line.")],
    station: StationOption,
    html: Annotated[
        Path | None, typer.Option("--html", metavar="FILE", help="Page with the episodes that is written.")
    ] = None,
    as_station: AsStationOption = False,
    time_zone: TimeZoneOption = None,
    as_json: JsonOption = False,
) -> None:
    """Judge a recording with the streaming detector, and print the faults from their beginning to their end."""
    from wetwell.services.stations import find_station

    plant = find_station(station)
    rows = reading_of(time_zone, as_station=as_station).read_of(recording, plant)
    from wetwell.services.batch.recordings import detect as judge  # after what can be wrong: it takes a second
    from wetwell.services.batch.units import refuse_other_units

    refuse_other_units(rows, plant, recording)
    for name in rows.ignored:
        typer.echo(f"{recording}: column '{name}' is not known and is ignored", err=True)
    from wetwell.services.reports.episode_table import episode_rows

    told = judge(plant, rows, out, html)
    found = told["episodes"]
    shown = (
        [one.model_dump(mode="json", exclude={"schema_name"}) for one in found]
        if as_json
        else episode_rows(found, plant.pump_labels)
    )
    print_result(told | {"episodes": shown if as_json or shown else "none"}, as_json=as_json)


@app.command(cls=about("--recording"), rich_help_panel=JUDGE)
def backtest(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for backtest.json and backtest.html.")],
    station: Annotated[
        str | None,
        typer.Option("--station", metavar="FILE", help="Of the recordings and scenarios; a dataset has its own."),
    ] = None,
    recording: Annotated[
        list[Path] | None,
        typer.Option(
            "--recording", metavar="FILE", help="With truth columns; may be given again.", callback=all_there
        ),
    ] = None,
    scenario: Annotated[
        list[str] | None, typer.Option("--scenario", metavar="NAME", help="To simulate; may be given again.")
    ] = None,
    seeds: Annotated[int, number(low=1, help="Number of seeds of each scenario.")] = 1,
    first_seed: Annotated[int, number("--first-seed", low=0, help="The first of them.")] = 1,
    days: Annotated[
        float | None, typer.Option(metavar="NUMBER", help="Length of each; default: the scenario's.")
    ] = None,
    dataset: Annotated[
        Path | None, typer.Option("--dataset", metavar="DIR", help="Folder that `wetwell dataset` has made.")
    ] = None,
    history: Annotated[
        Path | None,
        typer.Option("--history", metavar="DIR", help="Score a history by what crews found; with --station NAME."),
    ] = None,
    detectors: Annotated[
        str,
        typer.Option(metavar="NAMES", help="With commas between; `all` for every one, FILE.py:CLASS for your own."),
    ] = "wetwell,paper_f_test,paper_tangent,paper_f_shift,paper_tangent_segments",
    learning_h: Annotated[
        float, number("--learning-h", low=0.0, help="Runs that end in these first hours are not scored.")
    ] = 6.0,
    workers: Annotated[int | None, number(low=1, help="Processes; default: as many as cores.")] = None,
    scheduler: SchedulerOption = None,
    as_station: AsStationOption = False,
    time_zone: TimeZoneOption = None,
    as_json: JsonOption = False,
) -> None:
    """Score verdicts against truth: ours, the paper's two methods and others; run again to resume."""
    from wetwell.services.batch.backtest import (
        Source,
        detector_names,
        items_of,
        overview,
        sources_of,
        write_backtest,
    )
    from wetwell.services.batch.executors import check_scheduler
    from wetwell.services.stations import find_scenario, find_station

    if history is not None:
        if station is None or recording or scenario or dataset:
            raise ConfigError("backtest: give --history DIR with --station NAME, and nothing else to score")
        print_result(_by_crews(history, station_name(station), out), as_json=as_json)
        return
    check_scheduler(scheduler)
    names = detector_names(detectors)
    length_s = None if days is None else max(round(positive(days, "--days") * 86_400.0), 1)
    reading = reading_of(time_zone, as_station=as_station)
    sources: list[Source] = []
    if station is not None:
        plans = [find_scenario(name) for name in scenario or []]
        trials = range(first_seed, first_seed + seeds)
        sources = sources_of(find_station(station), recording or [], plans, trials, length_s, reading)
    elif recording or scenario:
        raise ConfigError("backtest: give --station FILE with --recording and --scenario")
    if dataset is not None:
        sources += items_of(dataset)
    if not sources:
        raise ConfigError("backtest: give at least one --recording, --scenario or --dataset")
    processes = min(workers or cores(), len(sources))
    result = write_backtest(sources, names, out, processes, learning_h * 3600.0, scheduler)
    print_batch(result if as_json else overview(result), as_json=as_json)


def _by_crews(folder: Path, station: str, out: Path) -> dict[str, object]:
    """Score of a history, also as a file."""
    import json

    from wetwell.protocols.atomic_file import atomic_file
    from wetwell.services.batch.crews import score_history
    from wetwell.services.historian.store.opening import open_store

    with open_store(with_history(settings_of(None), folder).historian, alone=False, must_exist=True) as store:
        score = score_history(store, station)
    out.mkdir(parents=True, exist_ok=True)
    with atomic_file(out / "crews.json") as file:
        file.write((json.dumps(score, indent=2) + "\n").encode())
    return score
