"""Results of commands for people and as JSON; the figures of a recording."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from wetwell.protocols.timestamps import to_iso
from wetwell.services.reports.text_table import SCREEN_WIDTH, folded, shown, text_table

if TYPE_CHECKING:
    from wetwell.protocols.recordings.kpi import Kpis


def as_json(value: object) -> str:
    """JSON text for standard output."""
    return json.dumps(value, indent=2)


ONE_SAMPLE_S = 1.0
"""Of a recording with so many seconds a row nothing needs to be said: pumps do not stop within them. [s]"""


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
        if isinstance(value, Mapping) and value:
            lines += [f"{indent}{key}:", as_lines(value, indent + "  ")]
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            table = text_table(value, SCREEN_WIDTH - len(indent) - 2)
            lines += [f"{indent}{key}:", *(f"{indent}  {line}" for line in table)]
        else:
            lines.append(folded(f"{indent}{key}: {shown(value)}"))
    return "\n".join(lines)


def named(key: object, labels: Sequence[str]) -> object:
    """Number of a pump, or an asset, and beside it what people call that pump, where `labels` say it.

    Examples
    --------
    >>> labels = ("Pumpwerk Süd 1", "Pumpwerk Süd 2")
    >>> named(2, labels), named("pump:2", labels), named("main", labels), named(2, ())
    ('2 (Pumpwerk Süd 2)', 'pump:2 (Pumpwerk Süd 2)', 'main', 2)
    """
    kind, _, number = str(key).rpartition(":")
    if kind not in {"", "pump"} or not number.isdecimal() or int(number) > len(labels):
        return key
    label = labels[int(number) - 1]
    return key if label == number else f"{key} ({label})"


def titled(key: str, title: str | None) -> str:
    """Key of a station, and beside it what people call it, where that is known.

    Examples
    --------
    >>> titled("sued", "Pumpwerk Süd"), titled("sued", None)
    ('sued (Pumpwerk Süd)', 'sued')
    """
    return key if title is None else f"{key} ({title})"


def kpi_table(figures: "Kpis", labels: Sequence[str] = (), *, with_hours: bool) -> dict[str, object]:
    """Figures of a recording by day and in total, and by hour where asked for; what is not known is None.

    Parameters
    ----------
    figures : Kpis
    labels : sequence of str
        What people call the pumps, where their station is known.
    with_hours : bool
    """
    pumps = range(len(figures.starts))
    days = [
        {
            "day": to_iso(day_ns)[:10],
            **_named(pump, labels),
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
            **_named(pump, labels),
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
    table: dict[str, object] = {"days": days, "totals": totals, "station": station}
    if figures.step_s > ONE_SAMPLE_S:
        table["not_seen"] = f"starts and stops between two rows, of which there is one in {figures.step_s:g} s"
    return table | ({"hours": hours} if with_hours else {})


def _named(pump: int, labels: Sequence[str]) -> dict[str, Any]:
    return {"pump": pump + 1} | ({"name": labels[pump]} if pump < len(labels) else {})


def _figure(value: float) -> float | None:
    return round(float(value), 4) if math.isfinite(value) else None
