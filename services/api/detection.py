"""A recording judged in Python."""

import json
from dataclasses import dataclass, field
from functools import cached_property
from html import escape

import pyarrow as pa

from wetwell.detector.detector import Detector
from wetwell.detector.verdict.episodes import episodes_of
from wetwell.protocols.messages.history import Episode
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.recordings.reading import Reading
from wetwell.protocols.station.station_file import Station
from wetwell.services.api.result import Picture, Result
from wetwell.services.api.sources import RecordingSource, StationSource, rows_of, station_of
from wetwell.services.batch.units import refuse_other_units
from wetwell.services.reports.charts import table
from wetwell.services.reports.episode_table import episode_chart, episode_rows

TIME = pa.timestamp("ns", tz="UTC")


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

    @cached_property
    def episodes(self) -> tuple[Episode, ...]:
        """What was wrong: one fault of one asset from its beginning to its end, the first to begin first."""
        return tuple(episodes_of(self.verdicts))

    def to_arrow(self) -> pa.Table:
        """A row a verdict: time, pump, state, probability, asset, stage, onset, window, and the evidence as JSON."""
        rows = [
            {
                "time": verdict.time,
                "pump": verdict.pump,
                "state": verdict.state,
                "probability": verdict.probability.get(verdict.state),
                "asset": verdict.asset,
                "stage": verdict.stage,
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
            "asset": pa.string(),
            "stage": pa.string(),
            "onset": TIME,
            "begin": TIME,
            "end": TIME,
            "evidence": pa.string(),
        }
        return pa.Table.from_pylist(rows, schema=pa.schema(list(types.items())))

    def plot(self) -> Picture:
        """Bar of each episode over time, in the colour of its stage, a row an asset."""
        first_ns = min((verdict.window[0] for verdict in self.verdicts), default=0)
        last_ns = max((verdict.window[1] for verdict in self.verdicts), default=1)
        return Picture(episode_chart(self.episodes, first_ns, last_ns))

    def _repr_html_(self) -> str:
        told = f"{len(self.verdicts)} verdicts, {len(self.episodes)} episodes"
        rows = episode_rows(self.episodes, self.station.pump_labels)
        shown = table(list(rows[0]), [list(row.values()) for row in rows]) if rows else ""
        return f"<p>{escape(f'Station {self.station.label}: {told}')}</p>{shown}"


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
        If the recording cannot be read, is not of the station, or is in other units.
    """
    plant = station_of(station)
    rows = rows_of(recording, plant, Reading.said(time_zone, as_station=as_station))
    refuse_other_units(rows, plant, "recording")
    detector = Detector.of(plant)
    verdicts = detector.judge(rows)
    return Detection(station=plant, verdicts=tuple(verdicts), counts=dict(detector.counts))
