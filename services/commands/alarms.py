"""Alarms: the daemon, and the acts of operators."""

from typing import TYPE_CHECKING, Annotated

import typer

from wetwell.services.commands.inputs import CommandGroup, about
from wetwell.services.commands.options import (
    ConfigOption,
    JsonOption,
    StationNameOption,
    ZenohOption,
    print_result,
    run,
    settings_of,
    station_and_names,
    station_name,
)

if TYPE_CHECKING:
    from wetwell.services.runtime.settings import Settings

app = typer.Typer(cls=CommandGroup, invoke_without_command=True)

AlarmOption = Annotated[str, typer.Option("--alarm", metavar="ALARM", help="Such as pump2.pump_fault.")]
ByOption = Annotated[str, typer.Option("--by", metavar="NAME", help="Who does it; kept in the audit.")]
ReasonOption = Annotated[str, typer.Option("--reason", metavar="TEXT", help="Why; kept in the audit.")]


@app.callback()
def alarms(
    context: typer.Context,
    station: Annotated[
        list[str] | None,
        typer.Option("--station", metavar="FILE", help="Station file, for limits of the level; may be given again."),
    ] = None,
    held: Annotated[
        bool, typer.Option("--held", help="Miss nothing of the stations until their simulated plants are let go.")
    ] = False,
    zenoh: ZenohOption = None,
    config: ConfigOption = None,
) -> None:
    """Raise and clear the alarms of a site after ISA-18.2, and answer the acts of operators."""
    if context.invoked_subcommand is not None:
        return
    from wetwell.services.stations import find_station

    settings = settings_of(config, zenoh)
    from wetwell.services.alarms.daemon import serve_alarms

    run(settings, serve_alarms(settings, [find_station(name) for name in station or []], is_held=held))


@app.command("list", cls=about("--station"))
def list_command(
    station: Annotated[
        str, typer.Option("--station", metavar="NAME", help="Only of this station: its name or its file.")
    ] = "*",
    zenoh: ZenohOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """List the alarms that are not normal, the most urgent first."""
    import asyncio

    from wetwell.services.alarms.client import ask_alarms, list_alarms
    from wetwell.services.alarms.tables import alarm_lines

    name, title, labels = station_and_names(station)
    found = asyncio.run(ask_alarms(settings_of(config, zenoh), lambda bus: list_alarms(bus, name)))
    if as_json:
        print_result({"alarms": [alarm.model_dump(mode="json") for alarm in found]}, as_json=True)
    else:
        typer.echo(alarm_lines(found, labels, title))


@app.command()
def report(zenoh: ZenohOption = None, config: ConfigOption = None, as_json: JsonOption = False) -> None:
    """Print the alarm rates beside the targets of ISA-18.2, and the chattering and stale alarms."""
    import asyncio

    from wetwell.services.alarms.client import ask_alarms
    from wetwell.services.alarms.client import report as ask_report
    from wetwell.services.alarms.tables import report_lines

    answer = asyncio.run(ask_alarms(settings_of(config, zenoh), ask_report))
    if as_json:
        print_result(answer.model_dump(mode="json"), as_json=True)
    else:
        typer.echo(report_lines(answer))


def _add_act(act: str, text: str) -> None:
    """Add the command of an act that needs no more than an alarm and a name."""

    @app.command(act.replace("_", "-"), help=text, cls=about("--alarm"))
    def command(
        alarm: AlarmOption,
        station: StationNameOption,
        by: ByOption,
        reason: ReasonOption = "",
        zenoh: ZenohOption = None,
        config: ConfigOption = None,
        as_json: JsonOption = False,
    ) -> None:
        _act(act, (station, alarm, by, reason), None, settings_of(config, zenoh), as_json=as_json)


_add_act("acknowledge", "Say that an alarm was seen.")
_add_act("reset", "Let a latched alarm go that was acknowledged.")


@app.command(cls=about("--alarm"))
def shelve(
    alarm: AlarmOption,
    station: StationNameOption,
    by: ByOption,
    minutes: Annotated[
        float, typer.Option("--minutes", metavar="NUMBER", help="For how long on the wall clock, at most a week.")
    ],
    reason: ReasonOption = "",
    zenoh: ZenohOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Put an alarm on the shelf for a time: nobody is called by it."""
    _act("shelve", (station, alarm, by, reason), minutes, settings_of(config, zenoh), as_json=as_json)


_add_act("unshelve", "Take an alarm from the shelf before its time.")
_add_act("out_of_service", "Take an alarm out of service, for maintenance, until it is put in again.")
_add_act("in_service", "Put an alarm into service again.")


def _add_mode(act: str, text: str) -> None:
    """Add the command of an act on the mode of a station."""

    @app.command(act, help=text, cls=about("--station"))
    def command(
        station: StationNameOption,
        by: ByOption,
        reason: ReasonOption = "",
        zenoh: ZenohOption = None,
        config: ConfigOption = None,
        as_json: JsonOption = False,
    ) -> None:
        _act(act, (station, "station", by, reason), None, settings_of(config, zenoh), as_json=as_json)


_add_mode("maintenance", "Say that somebody works on a station: its faults call nobody until it resumes.")
_add_mode("stop", "Say that a station is not to run: all but a flood calls nobody until it resumes.")
_add_mode("resume", "End the maintenance or the stop of a station.")


def _act(
    act: str, words: tuple[str, str, str, str], minutes: float | None, settings: "Settings", *, as_json: bool
) -> None:
    import asyncio

    from wetwell.services.alarms.client import ask_alarms, new_act, send_act

    station, alarm, by, reason = words
    order = new_act(station_name(station), alarm, act, by, minutes, reason)
    answer = asyncio.run(ask_alarms(settings, lambda bus: send_act(bus, order)))
    result: dict[str, object] = {"done": answer.is_done}
    if answer.alarm is not None:
        result |= answer.alarm.model_dump(mode="json", exclude_none=True)
    else:
        result["reason"] = answer.reason
    print_result(result, as_json=as_json)
    if not answer.is_done:
        raise typer.Exit(1)
