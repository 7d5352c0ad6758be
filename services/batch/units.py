"""Recordings in other units are refused before they are judged or fitted."""

from dataclasses import replace
from pathlib import Path

from wetwell.protocols.errors import RecordingError
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.preparation import Preparation, prepare
from wetwell.sim2real.replay.units import check_units

LOOKED_AT_ROWS = 250_000
"""That are looked at: more than two days of seconds."""


def refuse_other_units(recording: Recording, station: Station, place: Path | str) -> None:
    """Refuse a recording whose values are in other units than ours, by what its station gives.

    Parameters
    ----------
    recording : Recording
        As it was read: rows may be in any order.
    station : Station
    place : Path or str
        What the line that refuses begins with.

    Raises
    ------
    RecordingError
        Says quantity, unit and factor.
    """
    columns = {name: values[:LOOKED_AT_ROWS] for name, values in recording.columns.items()}
    rows = replace(recording, time_ns=recording.time_ns[:LOOKED_AT_ROWS], columns=columns, truth={})
    try:
        rows, _ = prepare(rows, Preparation())
    except ValueError:
        return  # it is told by whoever needs it in order
    try:
        check_units(rows, station)
    except ValueError as error:
        raise RecordingError(f"{place}: {error}") from error
