"""What each stage asks of a recording before it looks at its values."""

import numpy as np

from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station


def check_rising(recording: Recording) -> None:
    """Refuse rows that are out of order or doubled.

    Raises
    ------
    ValueError
        If times do not rise.
    """
    if np.any(np.diff(recording.time_ns) <= 0):
        raise ValueError("times must rise: prepare the recording first")


def check_pumps(recording: Recording, station: Station) -> None:
    """Refuse a recording that speaks of other pumps.

    Raises
    ------
    ValueError
        If the numbers of pumps differ.
    """
    pumps = len(station.pump)
    if recording.pumps != pumps:
        raise ValueError(f"the recording has {recording.pumps} pumps, station '{station.name}' {pumps}")
