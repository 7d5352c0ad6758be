"""A recording judged in Python."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import groupby

import numpy as np
import pyarrow as pa

from wetwell.detector.detector import Detector
from wetwell.detector.stream.block import blocks
from wetwell.protocols.messages.verdict import State, Verdict
from wetwell.protocols.recordings.reading import Reading
from wetwell.protocols.station.station_file import Station
from wetwell.services.api.result import Picture, Result, html_table
from wetwell.services.api.sources import RecordingSource, StationSource, rows_of, station_of
from wetwell.services.reports.charts import Series, Span, line_chart

QUIET: frozenset[State] = frozenset({"learning", "normal"})
"""States that are no episode."""
TIME = pa.timestamp("ns", tz="UTC")


@dataclass(frozen=True, slots=True, kw_only=True)
class Episode:
    """Verdicts in a row that say the same of a pump, and that it is not well.

    Attributes
    ----------
    pump : int
        From 1.
    state : str
        What they say, such as `pump_fault`.
    start_ns, end_ns : int
        Onset, where it is told, or the time of the first of them; time of the last. [ns since 1970]
    verdicts : int
        How many there are.
    """

    pump: int
    state: State
    start_ns: int
    end_ns: int
    verdicts: int


@dataclass(frozen=True, kw_only=True)
class Detection(Result):
    """Verdicts on a recording.

    Attributes
    ----------
    station : Station
    verdicts : tuple of Verdict
        In the order in which they were told, as `verdicts.jsonl` of `wetwell detect` has them.
    counts : dict
        Samples and values by mark.
    """

    station: Station = field(repr=False)
    verdicts: tuple[Verdict, ...] = field(repr=False)
    counts: dict[str, int]

    @property
    def episodes(self) -> tuple[Episode, ...]:
        """What was wrong, by pump and time; normal and learning are left out."""
        return tuple(episode for pump in range(1, len(self.station.pump) + 1) for episode in self._episodes(pump))

    def _episodes(self, pump: int) -> list[Episode]:
        told = [verdict for verdict in self.verdicts if verdict.pump == pump]
        return [
            Episode(
                pump=pump,
                state=state,
                start_ns=first.time if first.onset is None else first.onset,
                end_ns=run[-1].time,
                verdicts=len(run),
            )
            for state, group in groupby(told, key=lambda verdict: verdict.state)
            if state not in QUIET and (run := list(group)) and (first := run[0])
        ]

    def to_arrow(self) -> pa.Table:
        """A row a verdict: time, pump, state, its probability, onset, window, and the evidence as JSON."""
        rows = [
            {
                "time": verdict.time,
                "pump": verdict.pump,
                "state": verdict.state,
                "probability": verdict.probability.get(verdict.state),
                "onset": verdict.onset,
                "begin": verdict.window[0],
                "end": verdict.window[1],
                "evidence": json.dumps(verdict.evidence),
            }
            for verdict in self.verdicts
        ]
        types = {
            "time": TIME,
            "pump": pa.int16(),
            "state": pa.string(),
            "probability": pa.float64(),
            "onset": TIME,
            "begin": TIME,
            "end": TIME,
            "evidence": pa.string(),
        }
        return pa.Table.from_pylist(rows, schema=pa.schema(list(types.items())))

    def plot(self) -> Picture:
        """How far the operating point of each pump has left the learnt pump curve, and the episodes. [m]."""
        labels = self.station.pump_labels
        series = [self._shifts(pump) for pump in range(1, len(labels) + 1)]
        spans = [
            Span(f"{labels[one.pump - 1]}: {one.state.replace('_', ' ')}", one.start_ns, one.end_ns)
            for one in self.episodes
        ]
        title = f"Station {self.station.label}: shift of the pump curve"
        return Picture(line_chart(title, series, y_label="shift [m]", is_time=True, spans=spans))

    def _shifts(self, pump: int) -> Series:
        told = [one for one in self.verdicts if one.pump == pump and "shift_m" in one.evidence]
        shifts_m = np.array([one.evidence["shift_m"]["pump"] for one in told], dtype=float)
        return Series(f"pump {self.station.pump_names[pump - 1]}", np.array([one.time for one in told]), shifts_m)

    def _repr_html_(self) -> str:
        title = f"Station {self.station.label}: {len(self.verdicts)} verdicts, {len(self.episodes)} episodes"
        return f"<p>{escape(title)}</p>{html_table(episode_table(self.episodes, self.station.pump_labels), rows=20)}"


def episode_table(episodes: Sequence[Episode], labels: Sequence[str]) -> pa.Table:
    """Arrow table of episodes, with what people call the pumps."""
    columns = {
        "pump": pa.array([one.pump for one in episodes], pa.int16()),
        "name": pa.array([labels[one.pump - 1] for one in episodes], pa.string()),
        "state": pa.array([one.state for one in episodes], pa.string()),
        "from": pa.array([one.start_ns for one in episodes], TIME),
        "to": pa.array([one.end_ns for one in episodes], TIME),
        "verdicts": pa.array([one.verdicts for one in episodes], pa.int64()),
    }
    return pa.table(columns)


def detect(
    recording: RecordingSource, station: StationSource, *, time_zone: str | None = None, as_station: bool = False
) -> Detection:
    """Judge a recording with the streaming detector.

    Parameters
    ----------
    recording : path or table
        As `read` takes it. Truth columns are not looked at.
    station : Station, path or name
    time_zone, as_station
        As `read` takes them.

    Raises
    ------
    RecordingError
        If the recording cannot be read or is not of the station.
    """
    plant = station_of(station)
    rows = rows_of(recording, plant, Reading.said(time_zone, as_station=as_station))
    detector = Detector.of(plant)
    verdicts = [verdict for block in blocks(rows, len(plant.pump)) for verdict in detector.update_block(block)]
    verdicts += detector.finish()
    return Detection(station=plant, verdicts=tuple(verdicts), counts=dict(detector.counts))
