"""Recordings: made, prepared, converted, summed up."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, cast

import typer

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.recordings.reading import Reading
from wetwell.services.commands.options import (
    AsStationOption,
    JsonOption,
    PreparationOption,
    RecordingOption,
    ScenarioOption,
    SchedulerOption,
    SeedOption,
    StationOption,
    TimeZoneOption,
    plant_of,
    positive,
    print_batch,
    print_result,
)

if TYPE_CHECKING:
    from wetwell.protocols.station.station_file import Station

app = typer.Typer()

StationCheckOption = Annotated[
    str | None, typer.Option("--station", metavar="FILE", help="Station that the recording has to be of.")
]


@app.command()
def simulate(
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="CSV, CSV.gz or Parquet.")],
    station: StationOption,
    scenario: ScenarioOption = "nominal",
    days: Annotated[float | None, typer.Option(help="Length; default: the scenario's.")] = None,
    seed: SeedOption = 1,
    as_json: JsonOption = False,
) -> None:
    """Write a simulated recording, with truth columns."""
    from wetwell.services.batch.recordings import simulate as write
    from wetwell.services.stations import find_scenario
    from wetwell.simulator.scenario import DEFAULT_START_NS

    plant = plant_of(station, find_scenario(scenario), seed, DEFAULT_START_NS)
    length_s = plant.scenario.duration_s if days is None else positive(days, "--days") * 86_400.0
    rows = write(plant, max(round(length_s), 1), out)
    summary = {"recording": str(out), "rows": rows, "station": plant.station.name, "seed": seed}
    print_result(summary, as_json=as_json)


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
    scheduler: SchedulerOption = None,
    check: Annotated[
        Path | None, typer.Option("--check", metavar="DIR", help="Make nothing: verify the checksums of a dataset.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Make a balanced, labelled set of recordings over sampled stations and faults; run again to resume."""
    from wetwell.services.batch.dataset import check_dataset, make_dataset, plan_of
    from wetwell.services.batch.executors import check_scheduler
    from wetwell.services.stations import find_station

    if (out is None) == (check is None):
        raise ConfigError("dataset: give either --out DIR or --check DIR")
    if check is not None:
        return print_result(check_dataset(check), as_json=as_json)
    check_scheduler(scheduler)
    if not station:
        raise ConfigError("dataset: give at least one --station FILE")
    bases = [find_station(name) for name in station]
    plan = plan_of(bases, seed, count, positive(days, "--days"), form)
    processes = min(workers or os.cpu_count() or 1, count)
    return print_batch(make_dataset(plan, cast("Path", out), processes, scheduler), as_json=as_json)


@app.command()
def convert(
    sources: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Export, of one file or of several.")],
    mapping: Annotated[
        Path | None, typer.Option("--mapping", metavar="FILE", help="TOML file: which tag is which signal.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="FILE", help="CSV, CSV.gz or Parquet.")] = None,
    draft: Annotated[
        Path | None,
        typer.Option("--draft", metavar="FILE", help="Look at the export and write a mapping."),
    ] = None,
    station: Annotated[
        str | None,
        typer.Option("--station", metavar="FILE", help="Station file, for drives in % of their nominal frequency."),
    ] = None,
    form: Annotated[Literal["skab"], typer.Option("--from", help="Form of a file without mapping.")] = "skab",
    as_json: JsonOption = False,
) -> None:
    """Turn an export of another system into a recording."""
    from wetwell.protocols.recordings.importers import IMPORTERS
    from wetwell.protocols.recordings.recording import write_recording
    from wetwell.services.batch.conversion import convert_files, draft_mapping

    if (out is None) == (draft is None) or (draft is not None and mapping is not None):
        raise ConfigError("convert: give --mapping FILE and --out FILE, or --draft FILE")
    if draft is not None:
        return print_result(draft_mapping(sources, draft), as_json=as_json)
    out = cast("Path", out)
    if mapping is not None:
        return print_result(convert_files(sources, mapping, out, _station(station)), as_json=as_json)
    if len(sources) > 1:
        raise ConfigError(f"convert: got {len(sources)} files, without --mapping it takes one")
    recording = IMPORTERS[form](sources[0])
    write_recording(recording, out)
    return print_result(
        {"recording": str(out), "rows": len(recording), "columns": sorted(recording.columns)}, as_json=as_json
    )


@app.command()
def prepare(
    recording: RecordingOption,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="CSV, CSV.gz or Parquet.")],
    preparation: PreparationOption = None,
    station: StationCheckOption = None,
    as_station: AsStationOption = False,
    time_zone: TimeZoneOption = None,
    as_json: JsonOption = False,
) -> None:
    """Prepare a recording from the field: units, offsets, order, doubles; list its gaps."""
    from wetwell.services.batch.field_data import prepare_file

    reading = Reading.said(time_zone, as_station=as_station)
    print_result(prepare_file(recording, preparation, out, _station(station), reading), as_json=as_json)


@app.command()
def calibrate(
    recording: RecordingOption,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="Station file that is written.")],
    station: StationOption,
    preparation: PreparationOption = None,
    as_station: AsStationOption = False,
    time_zone: TimeZoneOption = None,
    as_json: JsonOption = False,
) -> None:
    """Fit a station file to a recording, with intervals; says what the recording cannot tell."""
    from wetwell.services.batch.field_data import calibrate_file
    from wetwell.services.stations import find_station

    reading = Reading.said(time_zone, as_station=as_station)
    print_result(calibrate_file(find_station(station), recording, preparation, out, reading), as_json=as_json)


@app.command()
def validate(
    recording: RecordingOption,
    station: StationOption,
    preparation: PreparationOption = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Simulated recording that is written.")
    ] = None,
    html: Annotated[
        Path | None, typer.Option("--html", metavar="FILE", help="Page with plots that is written; needs no network.")
    ] = None,
    before: Annotated[
        str | None,
        typer.Option("--before", metavar="FILE", help="Station file to compare row by row beside it."),
    ] = None,
    as_station: AsStationOption = False,
    time_zone: TimeZoneOption = None,
    as_json: JsonOption = False,
) -> None:
    """Compare a station file with a recording: row by row, and free-running where levels start the pumps."""
    from wetwell.services.batch.field_data import validate_file
    from wetwell.services.stations import find_station

    reading = Reading.said(time_zone, as_station=as_station)
    plant, other = find_station(station), None if before is None else find_station(before)
    print_result(validate_file(plant, recording, preparation, out, html, reading, before=other), as_json=as_json)


@app.command()
def kpi(
    recording: RecordingOption,
    station: StationCheckOption = None,
    as_station: AsStationOption = False,
    time_zone: TimeZoneOption = None,
    as_json: JsonOption = False,
) -> None:
    """Print energy, starts, run time and volume of a recording, by day and in total."""
    from wetwell.protocols.recordings.kpi import kpis
    from wetwell.services.reports.tables import kpi_table

    reading, plant = Reading.said(time_zone, as_station=as_station), _station(station)
    rows = reading.read(recording) if plant is None else reading.read_of(recording, plant)
    print_result(kpi_table(kpis(rows), with_hours=as_json), as_json=as_json)


def _station(name: str | None) -> "Station | None":
    if name is None:
        return None
    from wetwell.services.stations import find_station  # brings the compiled simulator, which takes seconds

    return find_station(name)
