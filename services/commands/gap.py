"""The gap between simulation and reality."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from wetwell.protocols.errors import ConfigError
from wetwell.services.commands.inputs import CommandGroup, about
from wetwell.services.commands.options import (
    AsStationOption,
    ConfigOption,
    JsonOption,
    RecordingOption,
    SchedulerOption,
    SeedOption,
    StationOption,
    TimeZoneOption,
    ZenohOption,
    all_there,
    cores,
    listed,
    names_apart,
    number,
    positive,
    print_batch,
    print_result,
    reading_of,
    run,
    settings_of,
    signals_named,
    there,
    with_history,
)

app = typer.Typer(cls=CommandGroup, no_args_is_help=True, help="The gap between simulation and reality.")


@app.command("trial")
def gap_trial(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder that is made or completed.")],
    seed: SeedOption = 1,
    cases: Annotated[int, number(low=1, help="Number of sealed cases.")] = 50,
    plant: Annotated[
        Literal["fine", "swmm", "elastic", "both", "all"],
        typer.Option(help="What stands for reality; both: fine and swmm."),
    ] = "fine",
    kinds: Annotated[
        str, typer.Option(metavar="NAMES", help="Of single, pair, none, open, leave_one_out, triple; with commas.")
    ] = "single,pair,none,open,leave_one_out,triple",
    effects: Annotated[
        str, typer.Option(metavar="NAMES", help="One of these acts in each case that the library holds; with commas.")
    ] = "",
    days: Annotated[
        float | None,
        typer.Option(
            metavar="NUMBER", help="Length of each recording; default 1, or 14 with rows further apart than a minute."
        ),
    ] = None,
    every: Annotated[str, typer.Option(metavar="S", help="Seconds from row to row; several with commas.")] = "1",
    value: Annotated[
        str, typer.Option(metavar="NAMES", help="What a row holds: of instant, mean, held; several with commas.")
    ] = "instant",
    without_signals: Annotated[
        str,
        typer.Option("--without-signals", metavar="NAMES", help="Of level, inflow, flow, head, power; with commas."),
    ] = "",
    with_inflow: Annotated[
        float, number("--with-inflow", low=0.0, high=1.0, help="Share of the cases with an inflow meter.")
    ] = 0.5,
    workers: Annotated[int, number(low=1, help="Diagnoses at once.")] = 1,
    scheduler: SchedulerOption = None,
    recalibration: Annotated[
        bool, typer.Option("--recalibration", help="Diagnose each case once more by recalibration only.")
    ] = False,
    unseen: Annotated[
        bool, typer.Option("--unseen", help="Measure the shrinkage on recordings that no diagnosis has seen.")
    ] = False,
    looked_at: Annotated[
        bool, typer.Option("--looked-at", help="Take a seed whose cases were looked at; no headline figure.")
    ] = False,
    diagnoser: Annotated[
        str | None, typer.Option("--diagnoser", metavar="COMMAND", help="In place of wetwell gap diagnose.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Check the diagnosis on sealed recordings of other plants; run again to resume."""
    import shlex

    from wetwell.services.batch.executors import check_scheduler

    check_scheduler(scheduler)
    from wetwell.services.trial.looked_at import check_seed
    from wetwell.services.trial.plan import (
        DIAGNOSE,
        REPLAY,
        TrialPlan,
        parse_effects,
        parse_kinds,
        parse_rates,
        parse_values,
    )
    from wetwell.services.trial.result import brief
    from wetwell.services.trial.run import run_trial
    from wetwell.sim2real.trial.cases import StoragePlan
    from wetwell.sim2real.trial.families import PLANTS

    check_seed(seed, is_looked_at=looked_at)
    rates_s = parse_rates(every)
    if days is None:
        days = 1.0 if max(rates_s) <= 60 else 14.0
    plants = PLANTS if plant == "all" else ("fine", "swmm") if plant == "both" else (plant,)
    plan = TrialPlan(
        seed=seed,
        count=cases,
        kinds=parse_kinds(kinds),
        plants=plants,
        effects=parse_effects(effects, plants),
        seconds=round(positive(days, "--days") * 86_400.0),
        storage=StoragePlan(
            rates_s=rates_s,
            values=parse_values(value),
            absent=signals_named(without_signals, "--without-signals"),
            metered_share=with_inflow,
        ),
        command=DIAGNOSE if diagnoser is None else tuple(shlex.split(diagnoser)),
        replay=REPLAY if unseen else (),
        has_recalibration=recalibration,
    )
    result = run_trial(plan, out, workers, scheduler)
    print_batch(result if as_json else brief(result, out), as_json=as_json)


@app.command("families", cls=about("--trial"))
def gap_families(
    trials: Annotated[
        list[Path],
        typer.Option(
            "--trial", metavar="DIR", help="Folder of a trial that is scored; may be given again.", callback=all_there
        ),
    ],
    learnt_on: Annotated[
        str, typer.Option("--learnt-on", metavar="NAMES", help="Families that constants were learnt on; with commas.")
    ] = "",
    as_json: JsonOption = False,
) -> None:
    """Put trials of several families side by side: what each scores that was left out of the learning."""
    from wetwell.services.trial.families import families_table

    print_result(families_table(trials, listed(learnt_on)), as_json=as_json)


@app.command("diagnose", cls=about("--recording"))
def gap_diagnose(
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="DIR", help="For report and station file; of several diagnoses a folder each in it."
        ),
    ],
    recording: Annotated[
        list[Path] | None,
        typer.Option(
            "--recording",
            metavar="FILE",
            help="CSV, CSV.gz or Parquet; given again, all are diagnosed as one.",
            callback=all_there,
        ),
    ] = None,
    table: Annotated[
        Path | None,
        typer.Option("--recordings", metavar="TABLE", help="CSV file with columns station_file and recording."),
    ] = None,
    station: Annotated[
        str | None,
        typer.Option("--station", metavar="FILE", help="Of the recordings; a table names those of its own."),
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option(
            "--without", metavar="NAMES", help="Leave these effects out; with commas.", callback=names_apart
        ),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="NAMES", help="Try only these effects; with commas.", callback=names_apart),
    ] = None,
    apart: Annotated[
        bool, typer.Option("--apart", help="Diagnose each recording for itself, in a folder of its own.")
    ] = False,
    workers: Annotated[
        int | None, number(low=1, help="Processes for several diagnoses; default: as many as cores.")
    ] = None,
    scheduler: SchedulerOption = None,
    prior: Annotated[
        Path | None,
        typer.Option("--prior", metavar="FILE", help="Of wetwell gap fleet: what other stations say of this one."),
    ] = None,
    as_station: AsStationOption = False,
    time_zone: TimeZoneOption = None,
    as_json: JsonOption = False,
) -> None:
    """Say where a recording departs from the simulator, which effect causes it, and how far that closes the gap."""
    from wetwell.services.batch.executors import check_scheduler

    given, reading = recording or [], reading_of(time_zone, as_station=as_station)
    if not given and table is None:
        raise ConfigError("gap diagnose: give at least one --recording, or --recordings TABLE")
    check_scheduler(scheduler)
    is_batch = apart or table is not None or scheduler is not None
    if prior is not None and is_batch:
        raise ConfigError("gap diagnose: --prior is for one diagnosis: not with --apart, --recordings or --scheduler")
    if is_batch:
        from wetwell.services.batch.gap.diagnoses import cases_of, diagnose_all

        cases = cases_of(station, given, table, reading)
        processes = min(workers or cores(), max(len(cases), 1))
        result = diagnose_all(cases, out, processes, scheduler, only=only, without=without or ())
        return print_batch(result, as_json=as_json)
    from wetwell.services.stations import find_station

    if station is None:
        raise ConfigError("gap diagnose: give --station FILE with --recording")
    plant = find_station(station)
    from wetwell.services.batch.gap.diagnosis import diagnose_file
    from wetwell.services.batch.watch.prior import read_prior
    from wetwell.services.reports.gap.terminal import gap_lines, progress_bar

    known = None if prior is None else read_prior(prior)
    with progress_bar("diagnosis") as progress:
        report = diagnose_file(
            plant, given, out, reading, only=only, without=without or (), progress=progress, prior=known
        )
    return typer.echo(report.model_dump_json(by_alias=True, indent=2) if as_json else gap_lines(report, out))


@app.command("experiment", cls=about("--diagnosis"))
def gap_experiment(
    diagnosis: Annotated[
        Path, typer.Option("--diagnosis", metavar="DIR", help="Folder that gap diagnose wrote.", callback=there)
    ],
    station: Annotated[
        str | None, typer.Option("--station", metavar="FILE", help="Whose costs and levels count instead.")
    ] = None,
    inflow: Annotated[
        float | None,
        number("--inflow", metavar="M3H", low=0.0, help="Inflow at the time of the act; default: the mean."),
    ] = None,
    seed: SeedOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Say which act at the station tells apart what a diagnosis leaves open, and what it costs."""
    import json

    from wetwell.services.batch.gap.experiment import experiments_of
    from wetwell.services.reports.experiment_table import experiment_lines
    from wetwell.services.stations import find_station

    prices = None if station is None else find_station(station)
    told = experiments_of(diagnosis, prices=prices, inflow_m3h=inflow, seed=seed)
    typer.echo(json.dumps(told, indent=2, ensure_ascii=False) if as_json else experiment_lines(told))


@app.command("replay", cls=about("--recording"))
def gap_replay(
    recording: RecordingOption,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="CSV, CSV.gz or Parquet.")],
    station: StationOption,
    closed_loop: Annotated[
        bool,
        typer.Option("--closed-loop", help="Take only the inflow from the recording, not frequencies and level."),
    ] = False,
    as_station: AsStationOption = False,
    time_zone: TimeZoneOption = None,
    as_json: JsonOption = False,
) -> None:
    """Write what the simulator says for a recording, second by second."""
    from wetwell.services.stations import find_station

    reading, plant = reading_of(time_zone, as_station=as_station), find_station(station)
    from wetwell.services.batch.gap.diagnosis import replay_file

    print_result(replay_file(plant, recording, out, reading, closed_loop=closed_loop), as_json=as_json)


@app.command("watch", cls=about("--station"))
def gap_watch(
    station: Annotated[
        list[str] | None,
        typer.Option("--station", metavar="FILE", help="Station file or built-in station; may be given again."),
    ] = None,
    history: Annotated[
        Path | None,
        typer.Option("--history", metavar="DIR", help="Look at what this history holds, print it and end."),
    ] = None,
    state: Annotated[
        Path | None, typer.Option("--state", metavar="DIR", help="Where the watch keeps what it knows.")
    ] = None,
    zenoh: ZenohOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Keep up to date how far stations are from their simulators, since when, and what that is called."""
    from wetwell.services.stations import find_stations

    more: dict[str, object] = {} if state is None else {"watch": {"state_dir": state}}
    settings, stations = settings_of(config, zenoh, more=more), find_stations(station or ["alpha"])
    if history is None:
        from wetwell.services.watch.daemon import serve_watch

        return run(settings, serve_watch(settings, stations))
    import json

    from wetwell.services.batch.watch.history import watch_history
    from wetwell.services.historian.store.opening import open_store
    from wetwell.services.reports.gap.terminal import progress_bar
    from wetwell.services.watch.words import watch_lines

    kept = with_history(settings, history).historian
    with open_store(kept, alone=False, must_exist=True) as store, progress_bar("watch") as progress:
        told = [
            message
            for each in stations
            if (message := watch_history(store, each, settings.watch.state_dir, progress=progress)) is not None
        ]
    if as_json:
        return typer.echo(json.dumps([one.model_dump(mode="json") for one in told]))
    return typer.echo(watch_lines(told, {each.name: each.label for each in stations}))


@app.command("fleet", cls=about("--diagnoses"))
def gap_fleet(
    folders: Annotated[
        list[Path],
        typer.Option(
            "--diagnoses",
            metavar="DIR",
            help="With report.json or watched gaps in it; may be given again.",
            callback=all_there,
        ),
    ],
    out: Annotated[Path | None, typer.Option("--out", metavar="FILE", help="For gap diagnose --prior.")] = None,
    without: Annotated[
        str | None, typer.Option("--without", metavar="STATION", help="The one that is to be diagnosed.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Say which effects are usual in a fleet and how their sizes are spread, from its diagnoses."""
    from wetwell.services.batch.watch.prior import prior_of_folders, prior_rows, write_prior

    prior = prior_of_folders(folders, without)
    if out is not None:
        write_prior(prior, out)
    if as_json:
        return typer.echo(prior.model_dump_json(by_alias=True, indent=2))
    return print_result(prior_rows(prior), as_json=False)
