"""Methods scored against truth in Python, one's own among them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any

import pyarrow as pa

from wetwell.detector.evaluation.backtest import Outcome, summary
from wetwell.protocols.errors import RecordingError
from wetwell.protocols.recordings.reading import Reading
from wetwell.services.api.frame import Frame
from wetwell.services.api.result import Picture, Result, html_table
from wetwell.services.api.sources import RecordingSource, StationSource, rows_of, station_of
from wetwell.services.batch.backtest import detectors_named, scored
from wetwell.services.batch.own_methods import Method
from wetwell.services.reports.charts import bar_chart


@dataclass(frozen=True, kw_only=True)
class Backtest(Result):
    """Figures of methods on recordings with truth.

    Attributes
    ----------
    figures : mapping
        Of each method, as `backtest.json` of `wetwell backtest` has them under `detectors`.
    """

    figures: Mapping[str, Mapping[str, Any]]

    def to_arrow(self) -> pa.Table:
        """A row a method: runs, macro F1, false alarms a station-day, share of runs told `unknown`."""
        rows = [
            {
                "method": name,
                "runs": figures["runs"],
                "macro_f1": figures["macro_f1"],
                "false_alarms_a_day": figures["false_alarms"]["per_station_day"],
                "unknown": figures["abstention"]["unknown"],
            }
            for name, figures in self.figures.items()
        ]
        return pa.Table.from_pylist(rows)

    def plot(self) -> Picture:
        """Macro F1 of each method."""
        heights = [figures["macro_f1"] or 0.0 for figures in self.figures.values()]
        return Picture(bar_chart("Macro F1, 1 is best", list(self.figures), {"macro F1": heights}))

    def _repr_html_(self) -> str:
        return html_table(self.to_arrow(), rows=50)


def backtest(
    recordings: Iterable[RecordingSource],
    station: StationSource,
    methods: Mapping[str, Method] | Iterable[str] = ("wetwell",),
    *,
    learning_h: float = 6.0,
) -> Backtest:
    """Score methods against the truth columns of recordings, which no method sees.

    Parameters
    ----------
    recordings : list of paths or tables
        With truth columns, as `simulate` gives them.
    station : Station, path or name
    methods : mapping of name to class, or names
        A class of your own: a `RunDetector`, or whatever has `update_block` and `finish`. Names are those of
        `wetwell backtest --detectors`.
    learning_h : float
        Runs that end in these first hours are not scored. [h]

    Raises
    ------
    ConfigError
        If there is no method of a name.
    RecordingError
        If a recording has no truth, or is not of the station.
    """
    if isinstance(recordings, str | PathLike | Frame):
        raise TypeError("recordings: got one, must be a list of them")
    plant = station_of(station)
    judges = dict(methods) if isinstance(methods, Mapping) else detectors_named(methods)
    outcomes: dict[str, list[Outcome]] = {name: [] for name in judges}
    for number, source in enumerate(recordings, start=1):
        rows = rows_of(source, plant, Reading())
        for name, outcome in scored(rows, f"recording {number}", plant, judges, learning_h * 3600.0).items():
            outcomes[name].append(outcome)
    if not any(outcomes.values()):
        raise RecordingError("backtest: got no recording")
    return Backtest(figures={name: summary(found) for name, found in outcomes.items()})
