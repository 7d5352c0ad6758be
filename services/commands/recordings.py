"""Recordings: made, prepared, converted, summed up."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, cast

import typer

from wetwell.protocols.errors import ConfigError
from wetwell.services.commands.inputs import about
from wetwell.services.commands.options import (
    GAP,
    RECORD,
    AsStationOption,
    JsonOption,
    PreparationOption,
    RecordingOption,
    ScenarioOption,
    SchedulerOption,
    SeedOption,
    StationOption,
    TimeZoneOption,
    all_there,
    cores,
    number,
    plant_of,
    positive,
    print_batch,
    print_result,
    reading_of,
    stamp_of,
    station_if,
)

if TYPE_CHECKING:
    from wetwell.protocols.orders import Step

app = typer.Typer()

StationCheckOption = Annotated[
    str | None, typer.Option("--station", metavar="FILE", help="Station that the recording has to be of.")
]


@app.command(cls=about("--station"), rich_help_panel=RECORD)
def simulate(
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="CSV, CSV.gz or Parquet.")],
    station: StationOption,
    scenario: ScenarioOption = "nominal",
    days: Annotated[float | None, typer.Option(metavar="NUMBER", help="Length; default: the scenario's.")] = None,
    seed: SeedOption = 1,
    act: Annotated[
        Path | None,
        typer.Option("--act", metavar="FILE", help="Play the first experiment of a diagnosis' report.json."),
    ] = None,
    begin: Annotated[
        str | None, typer.Option("--begin", metavar="TIME", help="First sample, where the scenario names none.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Write a simulated recording, with truth columns."""
    from wetwell.services.stations import find_scenario
    from wetwell.simulator.scenario import DEFAULT_START_NS

    given_s = None if days is None else positive(days, "--days") * 86_400.0
    start_ns = DEFAULT_START_NS if begin is None else stamp_of(begin, "--begin")
    plant = plant_of(station, find_scenario(scenario), seed, start_ns, _steps_of(act))
    length_s = plant.scenario.duration_s if given_s is None else given_s
    from wetwell.services.batch.simulation import simulate as write

    rows = write(plant, max(round(length_s), 1), out)
    summary = {"recording": str(out), "rows": rows, "station": plant.station.name, "seed": seed}
    print_result(summary, as_json=as_json)


def _steps_of(act: Path | None) -> tuple["Step", ...]:
    """Steps of an experiment; what knows experiments loads most of the diagnosis."""
    if act is None:
        return ()
    from wetwell.services.batch.gap.experiment import steps_of

    return steps_of(act)


@app.command(cls=about("--station"), rich_help_panel=RECORD)
def dataset(
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder that is made or completed.")
    ] = None,
    count: Annotated[int, number(low=1, help="Number of recordings.")] = 100,
    seed: SeedOption = 1,
    station: Annotated[
        list[str] | None, typer.Option("--station", metavar="FILE", help="Base station; may be given again.")
    ] = None,
    days: Annotated[float, typer.Option(metavar="NUMBER", help="Length of each recording.")] = 1.0,
    form: Annotated[
        Literal["parquet", "csv.gz"], typer.Option("--format", help="Form of the recordings.")
    ] = "parquet",
    workers: Annotated[int | None, number(low=1, help="Processes; default: as many as cores.")] = None,
    scheduler: SchedulerOption = None,
    check: Annotated[
        Path | None, typer.Option("--check", metavar="DIR", help="Make nothing: verify the checksums of a dataset.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Make a balanced, labelled set of recordings over sampled stations and faults; run again to resume."""
    from wetwell.services.batch.executors import check_scheduler
    from wetwell.services.stations import find_station

    if (out is None) == (check is None):
        raise ConfigError("dataset: give either --out DIR or --check DIR")
    if check is not None:
        from wetwell.services.batch.dataset import check_dataset

        return print_result(check_dataset(check), as_json=as_json)
    check_scheduler(scheduler)
    if not station:
        raise ConfigError("dataset: give at least one --station FILE")
    bases = [find_station(name) for name in station]
    from wetwell.services.batch.dataset import make_dataset, plan_of

    plan = plan_of(bases, seed, count, positive(days, "--days"), form)
    processes = min(workers or cores(), count)
    return print_batch(make_dataset(plan, cast("Path", out), processes, scheduler), as_json=as_json)


@app.command(cls=about("--source"), rich_help_panel=RECORD)
def convert(
    sources: Annotated[
        list[Path],
        typer.Option("--source", metavar="FILE", help="File of the export; may be given again.", callback=all_there),
    ],
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
    form: Annotated[
        Literal["skab"], typer.Option("--from", metavar="FORM", help="Form of a file without mapping.")
    ] = "skab",
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
        return print_result(convert_files(sources, mapping, out, station_if(station)), as_json=as_json)
    if len(sources) > 1:
        raise ConfigError(f"convert: got {len(sources)} files, without --mapping it takes one")
    recording = IMPORTERS[form](sources[0])
    write_recording(recording, out)
    return print_result(
        {"recording": str(out), "rows": len(recording), "columns": sorted(recording.columns)}, as_json=as_json
    )


@app.command(cls=about("--recording"), rich_help_panel=RECORD)
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
    reading, plant = reading_of(time_zone, as_station=as_station), station_if(station)
    from wetwell.services.batch.field_data import prepare_file

    print_result(prepare_file(recording, preparation, out, plant, reading), as_json=as_json)


@app.command(cls=about("--recording"), rich_help_panel=GAP)
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
    from wetwell.services.stations import find_station

    reading, plant = reading_of(time_zone, as_station=as_station), find_station(station)
    from wetwell.services.batch.field_data import calibrate_file

    print_result(calibrate_file(plant, recording, preparation, out, reading), as_json=as_json)


@app.command(cls=about("--recording"), rich_help_panel=GAP)
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
    from wetwell.services.stations import find_station

    reading = reading_of(time_zone, as_station=as_station)
    plant, other = find_station(station), station_if(before)
    from wetwell.services.batch.field_data import validate_file

    print_result(validate_file(plant, recording, preparation, out, html, reading, before=other), as_json=as_json)


@app.command(cls=about("--recording"), rich_help_panel=RECORD)
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

    reading, plant = reading_of(time_zone, as_station=as_station), station_if(station)
    rows = reading.read(recording) if plant is None else reading.read_of(recording, plant)
    labels = () if plant is None else plant.pump_labels
    print_result(kpi_table(kpis(rows), labels, with_hours=as_json), as_json=as_json)
