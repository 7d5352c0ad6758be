"""A station fitted to a recording in Python."""

from dataclasses import dataclass, field
from html import escape

import pyarrow as pa

from wetwell.protocols.errors import RecordingError
from wetwell.protocols.recordings.reading import Reading
from wetwell.protocols.station.station_file import Station
from wetwell.services.api.result import Picture, StationResult, html_table
from wetwell.services.api.sources import RecordingSource, StationSource, rows_of, station_of
from wetwell.services.reports.charts import bar_chart
from wetwell.sim2real.calibration.calibration import calibrate as estimates_of
from wetwell.sim2real.calibration.estimates import Estimate
from wetwell.sim2real.calibration.fitted_station import with_estimates
from wetwell.sim2real.recording.preparation import Preparation, prepare
from wetwell.sim2real.replay.units import check_units


@dataclass(frozen=True, kw_only=True)
class Calibration(StationResult):
    """A station as a recording says that it is.

    Attributes
    ----------
    station : Station
        With the estimates in the place of what the file said.
    estimates : tuple of Estimate
        Value with a 95 % interval, or why it cannot be told.
    before : Station
        As it was given.
    """

    station: Station
    estimates: tuple[Estimate, ...]
    before: Station = field(repr=False)

    def to_arrow(self) -> pa.Table:
        """A row a parameter; `low` and `high` are null where the recording cannot tell it, and `reason` says why."""
        return pa.Table.from_pylist(
            [
                {
                    "name": estimate.name,
                    "unit": estimate.unit,
                    "value": float(estimate.value),
                    "low": None if estimate.interval is None else estimate.interval[0],
                    "high": None if estimate.interval is None else estimate.interval[1],
                    "reason": estimate.reason,
                }
                for estimate in self.estimates
            ],
            schema=pa.schema(
                [
                    ("name", pa.string()),
                    ("unit", pa.string()),
                    ("value", pa.float64()),
                    ("low", pa.float64()),
                    ("high", pa.float64()),
                    ("reason", pa.string()),
                ]
            ),
        )

    def plot(self) -> Picture:
        """Width of each 95 % interval over its value: what the recording tells well, and what it does not."""
        told = [one for one in self.estimates if one.interval is not None and one.value != 0.0]
        widths = [abs((one.interval[1] - one.interval[0]) / one.value) for one in told if one.interval is not None]
        names = [one.name for one in told]
        return Picture(bar_chart("Width of the 95 % interval over the value", names, {"width": widths}))

    def _repr_html_(self) -> str:
        title = f"Station {self.station.label} fitted: {len(self.estimates)} parameters"
        return f"<p>{escape(title)}</p>{html_table(self.to_arrow(), rows=50)}"


def calibrate(
    recording: RecordingSource, station: StationSource, *, time_zone: str | None = None, as_station: bool = False
) -> Calibration:
    """Fit a station to a recording.

    Parameters
    ----------
    recording : path or table
        As `read` takes it; rows are put in order, doubles are dropped.
    station : Station, path or name
        Starting point, and what is kept where the recording cannot tell.
    time_zone, as_station
        As `read` takes them.

    Raises
    ------
    RecordingError
        If the recording cannot be used.
    """
    plant = station_of(station)
    rows = rows_of(recording, plant, Reading.said(time_zone, as_station=as_station))
    try:
        in_order, _ = prepare(rows, Preparation())
        check_units(in_order, plant)
        estimates = estimates_of(in_order, plant)
        return Calibration(station=with_estimates(plant, estimates), estimates=tuple(estimates), before=plant)
    except ValueError as error:
        raise RecordingError(f"recording: {error}") from error
