"""What `wetwell up` prints: where to look, each change of state, what was seen."""

from collections.abc import Sequence

from wetwell.protocols.messages.plant_clock import PlantClock
from wetwell.protocols.messages.verdict import State, Verdict
from wetwell.protocols.modbus.registers import register_table
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S, to_iso
from wetwell.services.reports.text_table import SCREEN_WIDTH, folded
from wetwell.services.runtime.settings import Settings

WORDS: dict[State, str] = {
    "learning": "learning",
    "normal": "normal",
    "pump_fault": "PUMP FAULT",
    "system_fault": "SYSTEM FAULT",
    "pump_and_system_fault": "PUMP AND SYSTEM FAULT",
    "sensor_fault": "SENSOR FAULT",
    "unknown": "unknown",
}


FIGURES_INDENT = " " * len("2025-01-01T00:00:00Z  ")
"""Before the figures of a verdict that stand in a line of their own: they begin below the pump."""


def banner(settings: Settings, station: Station, scenario: str, speed: float) -> str:
    """Where to poll and what to subscribe to."""
    table = register_table(len(station.pump), len(station.control.start_levels_m))
    level = next(register for register in table if register.name == "level_m" and register.table == "input")
    modbus = settings.modbus
    host, port = settings.dashboard.host, settings.dashboard.port
    page = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    order = "-B " if modbus.word_order == "ABCD" else ""
    what = f"{len(station.pump)} pumps, scenario '{scenario}', {speed:g} times as fast as life"
    return f"""\
{folded(f"wetwell: station {station.label}, {what}")}

Page         http://{page}

Modbus TCP   {modbus.host}:{modbus.port}, unit id {modbus.unit_id}, {modbus.word_order}; map: wetwell modbus-map
  mbpoll -m tcp -p {modbus.port} -a {modbus.unit_id} -0 -r {level.address} -t 3:float {order}-1 {modbus.host}

Zenoh        {settings.zenoh.endpoint}
  import zenoh
  config = zenoh.Config()
  config.insert_json5("mode", '"client"')
  config.insert_json5("connect/endpoints", '["{settings.zenoh.endpoint}"]')
  with zenoh.open(config) as bus, bus.declare_subscriber("wetwell/{station.name}/**") as messages:
      for message in messages: print(message.key_expr, message.payload.to_string())
"""


def begin_line(*, has_keys: bool) -> str:
    """What stands before the first verdict."""
    keys = "Space holds it, + and - change its speed, q ends; so does Ctrl-C" if has_keys else "Ctrl-C stops"
    return f"All parts are ready, the plant begins.\n{keys}. Verdicts, in the station's time:\n"


def clock_line(clock: PlantClock) -> str:
    """How the clock of the plant stands.

    Examples
    --------
    >>> clock_line(PlantClock(station="alpha", seconds=30_000, speed=60, full_speed=600, is_held=False))
    '-- 60 times as fast as life'
    >>> clock_line(PlantClock(station="alpha", seconds=30_000, speed=60, full_speed=600, is_held=True))
    '-- the plant stands after 8.3 h of its time; space lets it go on'
    """
    if clock.is_held:
        return f"-- the plant stands after {clock.seconds / 3600.0:.1f} h of its time; space lets it go on"
    return f"-- {clock.speed:g} times as fast as life"


class StateLines:
    """Lines for people on the verdicts of a station: one where a state changes, or where learning goes on.

    Parameters
    ----------
    names : sequence of str
        What people call the pumps.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self._told: dict[int, tuple[State, str]] = {}

    def line(self, verdict: Verdict) -> str | None:
        """Line on a verdict; None where it says nothing new."""
        reason = str(verdict.evidence.get("reason", ""))
        news = (verdict.state, reason.split(".", 1)[0] if verdict.state == "learning" else "")
        is_news = self._told.get(verdict.pump) != news
        self._told[verdict.pump] = news
        return verdict_line(verdict, self._names) if is_news else None


def story_lines(changes: Sequence[Verdict], hours: float, names: Sequence[str]) -> str:
    """What a run has shown: each change of state, and of faults when they began and what to do."""
    lines = [f"What was seen in {hours:.1f} h of the station's time:"]
    for verdict in changes:
        if verdict.state == "learning":
            continue
        lines.append(verdict_line(verdict, names, "  "))
        said = [] if verdict.onset is None else [f"began about {to_iso(verdict.onset // NS_PER_S * NS_PER_S)}"]
        advice = verdict.evidence.get("advice")
        said += [str(advice)] if advice and verdict.state != "normal" else []
        if said:
            lines.append(folded(f"    {'; '.join(said)}"))
    return "\n".join(lines)


def verdict_line(verdict: Verdict, names: Sequence[str] = (), indent: str = "") -> str:
    """One line for people, with the name of the pump where that is not its number; its figures below if it is long.

    Examples
    --------
    >>> print(verdict_line(Verdict(
    ...     time=0, station="alpha", pump=2, state="pump_fault", probability={"pump_fault": 0.998, "normal": 0.002},
    ...     evidence={"shift_m": {"pump": -5.9, "system": 0.06}}, onset=0, window=(0, 0))))
    1970-01-01T00:00:00Z  pump 2  PUMP FAULT    p = 0.998  pump curve -5.90 m, system curve +0.06 m
    """
    number = str(verdict.pump)
    name = names[verdict.pump - 1] if verdict.pump <= len(names) else number
    pump = number if name == number else f"{number} ({name})"
    head = f"{indent}{to_iso(verdict.time)}  pump {pump}  {WORDS[verdict.state]:<12}"
    words = []
    if verdict.state in verdict.probability and verdict.state != "learning":
        words.append(f"p = {verdict.probability[verdict.state]:.3f}")
    if "shift_m" in verdict.evidence:
        shift_m = verdict.evidence["shift_m"]
        words.append(f"pump curve {shift_m['pump']:+.2f} m, system curve {shift_m['system']:+.2f} m")
    if "reason" in verdict.evidence:
        words.append(str(verdict.evidence["reason"]))
    line = "  ".join([head, *words]).rstrip()
    if len(line) <= SCREEN_WIDTH:
        return line
    return f"{head.rstrip()}\n{folded(indent + FIGURES_INDENT + '  '.join(words), hang=0)}"
