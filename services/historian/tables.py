"""Answers of the historian for people."""

from collections.abc import Sequence
from typing import Any

from wetwell.protocols.messages.history import Episode, History
from wetwell.protocols.timestamps import to_iso
from wetwell.services.reports.episode_table import episode_rows
from wetwell.services.reports.tables import named, titled

_SHOWN = {
    "verdicts": ("time", "pump", "state"),
    "changes": ("time", "pump", "state", "asset", "stage"),
    "alarms": ("time", "id", "priority", "state", "by", "text"),
    "maintenance": ("time", "asset", "act", "found", "by", "result"),
    "stations": ("station", "first", "last"),
}
_PUMPS = ("pump", "asset")
"""Columns that name a pump."""


def history_table(history: History, labels: Sequence[str] = (), title: str | None = None) -> dict[str, Any]:
    """Rows of an answer; of samples without least and largest values, of figures those of the whole station.

    Where `labels` and `title` say what people call the pumps and the station, that stands beside their keys.
    """
    if history.kind == "episodes":
        return {"episodes": episode_rows([Episode.model_validate(message) for message in history.messages], labels)}
    if history.kind in _SHOWN:
        names = _SHOWN[history.kind]
        return {
            history.kind: [
                {name: named(message.get(name), labels) if name in _PUMPS else message.get(name) for name in names}
                for message in history.messages
            ]
        }
    names = tuple(name for name in history.columns if not name.endswith(("_min", "_max")))
    if history.kind == "kpi":
        names = tuple(name for name in names if not name.startswith("pump"))
    rows = [
        {"time": to_iso(time_ns)} | {name: _short(history.columns[name][row]) for name in names}
        for row, time_ns in enumerate(history.time)
    ]
    return {"station": titled(history.station, title), history.kind: rows} | ({"more": True} if history.more else {})


def _short(value: float | None) -> str:
    return "" if value is None else f"{value:.5g}"
