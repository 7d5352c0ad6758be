"""History: the daemon that keeps it, questions to it, recordings out of it and into it, and the log of crews."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from wetwell.protocols.errors import ConfigError
from wetwell.services.commands.inputs import CommandGroup, about
from wetwell.services.commands.options import (
    OPERATE,
    RECORD,
    RUN,
    AsStationOption,
    ConfigOption,
    JsonOption,
    RecordingOption,
    StationNameOption,
    TimeZoneOption,
    ZenohOption,
    number,
    parse_duration_s,
    print_result,
    reading_of,
    run,
    settings_of,
    station_and_names,
    station_name,
    with_history,
)

app = typer.Typer()

DataOption = Annotated[
    Path | None, typer.Option("--data", metavar="DIR", help="Folder of the history; default: that of the settings.")
]
FromOption = Annotated[
    str | None, typer.Option("--from", metavar="TIME", help="ISO 8601, such as 2026-11-20T06:00:00Z.")
]
ToOption = Annotated[str | None, typer.Option("--to", metavar="TIME", help="Until before this time.")]


@app.command(rich_help_panel=RUN)
def historian(data: DataOption = None, zenoh: ZenohOption = None, config: ConfigOption = None) -> None:
    """Keep samples, verdicts and alarms of all stations, and answer questions about them."""
    settings = with_history(settings_of(config, zenoh), data)
    from wetwell.services.historian.daemon import serve_historian

    run(settings, serve_historian(settings))


@app.command(cls=about("--station"), rich_help_panel=OPERATE)
def history(
    station: StationNameOption = "alpha",
    kind: Annotated[
        Literal["samples", "verdicts", "changes", "alarms", "episodes", "maintenance", "kpi", "stations"],
        typer.Option("--kind", help="What is asked for."),
    ] = "kpi",
    last: Annotated[
        str | None, typer.Option(metavar="TIME", help="So long before the newest sample: 90s, 10m, 2h.")
    ] = None,
    start: FromOption = None,
    end: ToOption = None,
    points: Annotated[int, number(low=1, high=100_000, help="Most rows.")] = 100,
    raw: Annotated[bool, typer.Option("--raw", help="Samples themselves, from the oldest on.")] = False,
    zenoh: ZenohOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Ask a running historian for what it keeps of a station; `--kind stations` lists the stations."""
    import asyncio

    if last is not None and (start is not None or end is not None):
        raise ConfigError("history: give either --last or --from and --to")
    last_s, span = None if last is None else parse_duration_s(last, "--last"), _span(start, end)
    settings = settings_of(config, zenoh)
    from wetwell.protocols.bus.keys import SITE
    from wetwell.services.historian.client import ask_history
    from wetwell.services.historian.tables import history_table

    name, title, labels = station_and_names(station)
    asking = ask_history(
        settings,
        SITE if kind == "stations" else name,
        kind,
        last_s=last_s,
        span=span,
        points=points,
        raw=raw,
    )
    answer = asyncio.run(asking)
    if as_json:
        typer.echo(answer.encode().decode())
    else:
        print_result(history_table(answer, labels, title), as_json=False)


@app.command(cls=about("--station"), rich_help_panel=RECORD)
def export(
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="CSV, CSV.gz or Parquet.")],
    station: StationNameOption,
    start: FromOption = None,
    end: ToOption = None,
    data: DataOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Write a recording from the history; needs no running historian."""
    settings, span, name = with_history(settings_of(config), data), _span(start, end), station_name(station)
    from wetwell.services.historian.store.opening import open_store
    from wetwell.services.historian.transfer import export_recording

    with open_store(settings.historian, alone=False, must_exist=True) as store:
        rows = export_recording(store, name, *span, out)
    print_result({"recording": str(out), "station": name, "rows": rows}, as_json=as_json)


@app.command("import", cls=about("--recording"), rich_help_panel=RECORD)
def import_(
    recording: RecordingOption,
    station: Annotated[
        str | None,
        typer.Option("--station", metavar="NAME", help="Name of the station, or its file; default: the recording's."),
    ] = None,
    as_station: AsStationOption = False,
    time_zone: TimeZoneOption = None,
    data: DataOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Fill the history from a recording; what is there already stays as it is."""
    from wetwell.services.historian.store.opening import open_store
    from wetwell.services.historian.transfer import import_recording
    from wetwell.services.runtime.clock import now_ns
    from wetwell.services.security.audit import audit_in
    from wetwell.services.security.tokens import user

    reading = reading_of(time_zone, as_station=as_station)
    read = reading.read(recording)
    name = reading.name_for(read, None if station is None else station_name(station), recording)
    settings = with_history(settings_of(config), data)
    with open_store(settings.historian, alone=False) as store:
        folder = settings.historian.folder if settings.historian.url is None else settings.security.audit_dir
        audit_in(folder, "history").write(now_ns(), act="import", by=user(), station=name, recording=str(recording))
        rows, new = import_recording(store, name, read, recording)
    if read.value != "instant":
        typer.echo(f"{recording}: the history keeps values as instants, these are '{read.value}'", err=True)
    print_result({"station": name, "rows": rows, "new": new, "doubled": rows - new}, as_json=as_json)


maintenance_app = typer.Typer(
    cls=CommandGroup, no_args_is_help=True, help="Log what crews did and found, and what the detector saw of it."
)
app.add_typer(maintenance_app, name="maintenance", rich_help_panel=OPERATE)


@maintenance_app.command(cls=about("--station"))
def add(
    station: StationNameOption,
    asset: Annotated[
        str, typer.Option("--asset", metavar="NAME", help="Such as pump:2, main, sensor:pump2_flow_m3h.")
    ],
    act: Annotated[
        str, typer.Option("--act", metavar="TEXT", help="Such as pulled, flushed, calibrated, impeller replaced.")
    ],
    by: Annotated[str, typer.Option("--by", metavar="NAME", help="Who did it.")],
    found: Annotated[
        str, typer.Option("--found", metavar="TEXT", help="Such as rags; nothing, if all was well.")
    ] = "",
    at: Annotated[str | None, typer.Option("--at", metavar="TIME", help="ISO 8601; default: just now.")] = None,
    zenoh: ZenohOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Enter what a crew did and found; the detector checks it by the runs that follow."""
    import asyncio
    import uuid

    from pydantic import ValidationError

    from wetwell.protocols.errors import first_fault
    from wetwell.protocols.messages.maintenance import MaintenanceAct
    from wetwell.services.runtime.client import ask_service
    from wetwell.services.runtime.maintenance import ANSWER_S, entered

    name = station_name(station)
    fields = {"station": name, "asset": asset, "act": act, "found": found, "by": by, "time": at}
    try:
        order = MaintenanceAct.model_validate({"id": uuid.uuid4().hex, **fields})
    except ValidationError as error:
        raise ConfigError(f"maintenance: {first_fault(error)}") from error
    silence = f"station '{name}': no detector"
    record = asyncio.run(ask_service(settings_of(config, zenoh), lambda bus: entered(bus, order), silence, ANSWER_S))
    if record.refused:
        raise ConfigError(record.refused)
    print_result(record.model_dump(mode="json", exclude_defaults=True), as_json=as_json)


@maintenance_app.command("list", cls=about("--station"))
def list_maintenance(
    station: StationNameOption,
    zenoh: ZenohOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """List what crews did and found, and what the detector saw of it."""
    import asyncio

    from wetwell.protocols.messages.history import LONGEST_NS
    from wetwell.services.historian.client import ask_history
    from wetwell.services.historian.tables import history_table

    span, (name, _, labels) = (-LONGEST_NS, LONGEST_NS), station_and_names(station)
    asking = ask_history(
        settings_of(config, zenoh),
        name,
        "maintenance",
        last_s=None,
        span=span,
        points=1000,
        raw=False,
    )
    answer = asyncio.run(asking)
    if as_json:
        print_result({"maintenance": list(answer.messages)}, as_json=True)
    else:
        print_result(history_table(answer, labels) if answer.messages else {"maintenance": "none"}, as_json=False)


def _span(start: str | None, end: str | None) -> tuple[int, int]:
    from wetwell.protocols.messages.history import LONGEST_NS

    start_ns = -LONGEST_NS if start is None else _stamp_ns(start, "--from")
    end_ns = LONGEST_NS if end is None else _stamp_ns(end, "--to")
    if end_ns <= start_ns:
        raise ConfigError(f"--to: got '{end}', must lie after --from")
    return start_ns, end_ns


def _stamp_ns(text: str, flag: str) -> int:
    from wetwell.protocols.messages.history import LONGEST_NS
    from wetwell.protocols.timestamps import from_iso

    try:
        return min(max(from_iso(text), -LONGEST_NS), LONGEST_NS)
    except ValueError as error:
        raise ConfigError(f"{flag}: got '{text}', must be ISO 8601 such as 2025-01-31T06:00:00Z") from error
