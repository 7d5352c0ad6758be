"""What `wetwell up` prints: where to look, then each change of state."""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from wetwell.protocols.messages.messages import State, Verdict
from wetwell.protocols.modbus.registers import register_table
from wetwell.protocols.recordings.kpi import Kpis
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import to_iso
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


def banner(settings: Settings, station: Station, scenario: str, speed: float) -> str:
    """Where to poll and what to subscribe to."""
    table = register_table(len(station.pump), len(station.control.start_levels_m))
    level = next(register for register in table if register.name == "level_m" and register.table == "input")
    modbus = settings.modbus
    host, port = settings.dashboard.host, settings.dashboard.port
    page = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    order = "-B " if modbus.word_order == "ABCD" else ""
    return f"""\
wetwell: station '{station.name}', {len(station.pump)} pumps, scenario '{scenario}', {speed:g} times as fast as life

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

Ctrl-C stops. Verdicts, in the station's time:
"""


def line_printer(*, as_json: bool) -> Callable[[Verdict], None]:
    """Printer of verdicts: every one as JSON, or a line for people where a state changes or learning goes on."""
    told: dict[int, tuple[State, str]] = {}

    def show(verdict: Verdict) -> None:
        if as_json:
            print(verdict.encode().decode(), flush=True)  # noqa: T201 - this is what the command prints
            return
        reason = str(verdict.evidence.get("reason", ""))
        news = (verdict.state, reason.split(".", 1)[0] if verdict.state == "learning" else "")
        if told.get(verdict.pump) != news:
            print(verdict_line(verdict), flush=True)  # noqa: T201 - this is what the command prints
        told[verdict.pump] = news

    return show


def verdict_line(verdict: Verdict) -> str:
    """One line for people.

    Examples
    --------
    >>> print(verdict_line(Verdict(
    ...     time=0, station="alpha", pump=2, state="pump_fault", probability={"pump_fault": 0.998, "normal": 0.002},
    ...     evidence={"shift_m": {"pump": -5.9, "system": 0.06}}, onset=0, window=(0, 0))))
    1970-01-01T00:00:00Z  pump 2  PUMP FAULT             p = 0.998  pump curve -5.90 m, system curve +0.06 m
    """
    words = [f"{to_iso(verdict.time)}  pump {verdict.pump}  {WORDS[verdict.state]:<21}"]
    if verdict.state in verdict.probability and verdict.state != "learning":
        words.append(f"p = {verdict.probability[verdict.state]:.3f}")
    if "shift_m" in verdict.evidence:
        shift_m = verdict.evidence["shift_m"]
        words.append(f"pump curve {shift_m['pump']:+.2f} m, system curve {shift_m['system']:+.2f} m")
    if "reason" in verdict.evidence:
        words.append(str(verdict.evidence["reason"]))
    return "  ".join(words).rstrip()


def kpi_table(figures: Kpis, *, with_hours: bool) -> dict[str, object]:
    """Figures of a recording by day and in total, and by hour where asked for; what is not known is None."""
    pumps = range(len(figures.starts))
    days = [
        {
            "day": to_iso(day_ns)[:10],
            "pump": pump + 1,
            "starts": int(figures.daily_starts[pump, day]),
            "run_h": _figure(figures.daily_run_h[pump, day]),
            "volume_m3": _figure(figures.daily_volume_m3[pump, day]),
            "energy_kwh": _figure(figures.daily_energy_kwh[pump, day]),
            "known_h": _figure(figures.daily_known_h[day]),
        }
        for day, day_ns in enumerate(figures.day_ns.tolist())
        for pump in pumps
    ]
    totals = [
        {
            "pump": pump + 1,
            "starts": int(figures.starts[pump]),
            "run_h": _figure(figures.run_h[pump]),
            "volume_m3": _figure(figures.volume_m3[pump]),
            "energy_kwh": _figure(figures.energy_kwh[pump]),
            "specific_energy_kwh_m3": _figure(figures.specific_energy_kwh_m3[pump]),
            "duty_share": _figure(figures.duty_share[pump]),
        }
        for pump in pumps
    ]
    hours = [
        {
            "hour": to_iso(hour_ns),
            "energy_kwh": [_figure(kwh) for kwh in figures.hourly_energy_kwh[:, hour]],
            "station_energy_kwh": _figure(figures.station_hourly_energy_kwh[hour]),
            "cumulative_energy_kwh": [_figure(kwh) for kwh in figures.cumulative_energy_kwh[:, hour]],
        }
        for hour, hour_ns in enumerate(figures.hour_ns.tolist() if with_hours else [])
    ]
    station = {
        "volume_m3": _figure(figures.volume_m3.sum()),
        "energy_kwh": _figure(figures.energy_kwh.sum()),
        "specific_energy_kwh_m3": _figure(figures.station_specific_energy_kwh_m3),
    }
    return {"days": days, "totals": totals, "station": station} | ({"hours": hours} if with_hours else {})


def _figure(value: float) -> float | None:
    return round(float(value), 4) if math.isfinite(value) else None


def as_json(value: object) -> str:
    """JSON text for standard output."""
    return json.dumps(value, indent=2)


def as_lines(result: Mapping[str, object], indent: str = "") -> str:
    """A result for people: one value a line, a list of alike tables as one table.

    Examples
    --------
    >>> print(as_lines({"rows": 3, "pumps": [{"pump": 1, "head_m": 26.0}, {"pump": 2, "head_m": 25.5}]}))
    rows: 3
    pumps:
      pump  head_m
         1    26.0
         2    25.5
    """
    lines = []
    for key, value in result.items():
        if isinstance(value, Mapping):
            lines += [f"{indent}{key}:", as_lines(value, indent + "  ")]
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            lines += [f"{indent}{key}:", *_rows(value, indent + "  ")]
        else:
            lines.append(f"{indent}{key}: {value}")
    return "\n".join(lines)


def effect_lines(table: Sequence[Mapping[str, Any]]) -> str:
    """Effects for people: name, component and purpose, then one line a parameter.

    Examples
    --------
    >>> print(effect_lines([{"name": "motor_slip", "component": "drive", "summary": "Motors slip.",
    ...     "parameters": [{"name": "slip", "unit": "1", "low": 0.0, "high": 0.15, "neutral": 0.0}]}]))
    motor_slip (drive)
      Motors slip.
      slip: 0 to 0.15 [1]
    """
    lines = []
    for row in table:
        lines += [f"{row['name']} ({row['component']})", f"  {row['summary']}"]
        for parameter in row["parameters"]:
            allowed = f"{parameter['low']:g} to {parameter['high']:g}" if "low" in parameter else "any"
            allowed = ", ".join(parameter["choices"]) if "choices" in parameter else allowed
            unit = f" [{parameter['unit']}]" if "unit" in parameter else ""
            value = parameter.get("default")
            default = "" if value is None else f", default {value if isinstance(value, str) else format(value, 'g')}"
            lines.append(f"  {parameter['name']}: {allowed}{unit}{default}")
    return "\n".join(lines)


def _rows(tables: Sequence[Mapping[str, object]], indent: str) -> list[str]:
    cells = [list(tables[0]), *([str(value) for value in table.values()] for table in tables)]
    widths = [max(len(row[column]) for row in cells) for column in range(len(cells[0]))]
    return [indent + "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in cells]
