"""Alarms and their rates on a terminal."""

from collections.abc import Mapping, Sequence

from wetwell.protocols.messages.alarm import Alarm, AlarmReport
from wetwell.protocols.timestamps import NS_PER_S, to_iso
from wetwell.services.reports.tables import as_lines, named, titled

TARGETS: Mapping[str, str] = {
    "alarms_10min": "1 wanted, 2 at most in the long run, 10 at most ever",
    "alarms_hour": "6 wanted, 12 at most",
    "alarms_day": "150 wanted, 300 at most",
    "peak_10min": "10 at most",
    "flood_share": "under 0.01",
    "is_flood": "0",
}
"""What ISA-18.2 and EEMUA 191 want for one operator."""


def alarm_lines(alarms: Sequence[Alarm], labels: Sequence[str] = (), title: str | None = None) -> str:
    """A table of alarms for people; where `labels` and `title` say what they call pumps and station, with that.

    Examples
    --------
    >>> alarm = Alarm(id="pump2.pump_fault", time=0, station="alpha", pump=2, priority="high", is_active=True,
    ...     state="unacknowledged", text="pump 2: pump fault", advice="pull the pump", raised=0)
    >>> print(alarm_lines([alarm]))
    alarms:
      priority  station             alarm           state                raised  text        advice
          high    alpha  pump2.pump_fault  unacknowledged  1970-01-01T00:00:00Z  pump 2:     pull the
                                                                                 pump fault  pump
    """
    rows = [
        {
            "priority": alarm.priority,
            "station": titled(alarm.station, title),
            "alarm": alarm.id,
            **({"pump": named(alarm.pump or "", labels)} if labels else {}),
            "state": alarm.state if alarm.until is None else f"shelved until {to_iso(alarm.until)}",
            "raised": "" if alarm.raised is None else to_iso(alarm.raised // NS_PER_S * NS_PER_S),
            "text": alarm.text,
            "advice": alarm.advice,
        }
        for alarm in alarms
    ]
    return as_lines({"alarms": rows}) if rows else "no alarms"


def report_lines(report: AlarmReport) -> str:
    """Rates beside their targets, and the lists."""
    rates = [
        {"rate": name, "is": f"{value:g}", "target": TARGETS.get(name, "")} for name, value in report.rates.items()
    ]
    lists: dict[str, object] = {
        name: [figure.model_dump(mode="json", exclude_none=True) for figure in figures] or "none"
        for name, figures in (("chattering", report.chattering), ("stale", report.stale))
    }
    return as_lines({"rates": rates, "states": dict(report.standing) or "none", **lists})
