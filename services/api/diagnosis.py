"""A diagnosis of the gap in Python."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from html import escape
from typing import Literal

import pyarrow as pa

from wetwell.protocols.errors import RecordingError
from wetwell.protocols.recordings.reading import Reading
from wetwell.protocols.station.station_file import Station
from wetwell.services.api.result import Picture, StationResult, html_table
from wetwell.services.api.sources import RecordingSource, StationSource, rows_of, station_of
from wetwell.services.batch.gap.diagnosis import check_effects, diagnose_rows
from wetwell.services.reports.charts import bar_chart
from wetwell.services.reports.gap.lead import lead
from wetwell.services.reports.gap.page import gap_page
from wetwell.sim2real.diagnosis.report import FoundEffect, GapReport
from wetwell.sim2real.recording.preparation import Preparation, prepare


@dataclass(frozen=True, kw_only=True)
class Diagnosis(StationResult):
    """Where a recording departs from the simulator, and which effects of the library cause it.

    Attributes
    ----------
    report : GapReport
        All figures, as `report.json` of `wetwell gap diagnose` has them.
    station : Station
        With the effects that were found.
    sentence : str
        What, where, how large and how sure, in words.
    page : str
        The report as an HTML page.
    """

    report: GapReport
    station: Station = field(repr=False)
    sentence: str
    page: str = field(repr=False)

    @property
    def verdict(self) -> Literal["effect", "none", "unknown"]:
        """Whether there is a gap, and whether the library has its cause."""
        return self.report.verdict

    @property
    def effects(self) -> tuple[FoundEffect, ...]:
        """Effects that were found, with their parameters."""
        return self.report.effects

    def to_arrow(self) -> pa.Table:
        """A row a single effect that was tried: its score on cycles that it was not fitted to, and its shrinkage."""
        rows = [
            {"effect": one.name, "score": float(one.score), "shrinkage": float(one.shrinkage)}
            for one in self.report.candidates
        ]
        schema = pa.schema([("effect", pa.string()), ("score", pa.float64()), ("shrinkage", pa.float64())])
        return pa.Table.from_pylist(rows, schema=schema)

    def plot(self) -> Picture:
        """Gap of each signal before and after, in units of the noise."""
        signals = self.report.gap.by_signal
        bars = {
            "before": [float(gap.before) for gap in signals.values()],
            "after": [float(gap.after) for gap in signals.values()],
        }
        return Picture(bar_chart("Gap on cycles held out, 1 is noise", list(signals), bars))

    def _repr_html_(self) -> str:
        gap = self.report.gap
        found = ", ".join(effect.name for effect in self.effects) or "no effect"
        figures = f"gap {gap.before:.3g} before, {gap.after:.3g} after, {gap.floor:.3g} is noise alone"
        texts = (self.sentence, f"{found}: {figures}", f"Next: {self.report.next_experiment}")
        return "".join(f"<p>{escape(text)}</p>" for text in texts) + html_table(self.to_arrow(), rows=5)


def diagnose(
    recording: RecordingSource | list[RecordingSource],
    station: StationSource,
    *,
    only: Iterable[str] | None = None,
    without: Iterable[str] = (),
    time_zone: str | None = None,
    as_station: bool = False,
) -> Diagnosis:
    """Say where a recording departs from the simulator, which effect causes it, and how far that closes the gap.

    Parameters
    ----------
    recording : path or table, or list of them
        As `read` takes it; rows are put in order, doubles are dropped. Several are diagnosed as one.
    station : Station, path or name
    only, without : iterable of str
        Effects to try alone, or to leave out, by the names of `wetwell effects`.
    time_zone, as_station
        As `read` takes them.

    Raises
    ------
    ConfigError
        If an effect is not in the library.
    RecordingError
        If the recording cannot be used.
    """
    tried, left_out = None if only is None else list(only), list(without)
    check_effects([*(tried or ()), *left_out])
    plant = station_of(station)
    reading = Reading.said(time_zone, as_station=as_station)
    sources = recording if isinstance(recording, list) else [recording]
    rows = [prepare(rows_of(source, plant, reading), Preparation()) for source in sources]
    try:
        report, found = diagnose_rows(plant, rows, only=tried, without=left_out)
    except ValueError as error:
        raise RecordingError(f"recording: {error}") from error
    return Diagnosis(report=report, station=found.station, sentence=lead(report, found), page=gap_page(report, found))
