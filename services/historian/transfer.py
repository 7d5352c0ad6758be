"""Recordings out of a store, and into it."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.protocols.messages.history import LONGEST_NS
from wetwell.protocols.recordings.recording import Recording, recording_writer
from wetwell.protocols.station.station_file import NAME_PATTERN
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.store.interface import DAY_NS, Batch, Store, blocks


def export_recording(store: Store, station: str, start_ns: int, end_ns: int, path: Path) -> int:
    """Write the samples of a station from `start_ns` until before `end_ns` as a recording; returns its rows.

    Of samples at the same time only the first, by `seq`, is written, as a recording has no `seq`.

    Raises
    ------
    ConfigError
        If there is no such sample.
    RecordingError
        If the file cannot be written.
    """
    pumps = store.pumps(station, start_ns, end_ns)
    if pumps is None:
        raise ConfigError(f"station '{station}': no samples in this span of time")
    rows = 0
    with recording_writer(path) as write:
        for block in blocks(store, station, start_ns, end_ns):
            is_first = np.r_[True, np.diff(block.time_ns) > 0]
            write(replace(block.select(is_first).recording(pumps), station=station))
            rows += int(is_first.sum())
    return rows


def import_recording(store: Store, station: str, recording: Recording, path: Path) -> tuple[int, int]:
    """Keep the rows of a recording from a file; returns how many it has, and how many of them were new.

    A row at a time of which the store has a sample already, whatever its `seq`, is a double.

    Raises
    ------
    RecordingError
        If it has times that cannot be kept.
    ConfigError
        If the station's name is none.
    """
    if re.match(NAME_PATTERN, station) is None:
        raise ConfigError(f"--station: got '{station}', must be a name of letters, digits and ._-")
    samples = Samples.of_recording(recording)
    if len(samples) and max(abs(int(samples.time_ns[0])), abs(int(samples.time_ns[-1]))) > LONGEST_NS:
        raise RecordingError(f"{path}: column 'time': lies too far from 1970")
    new = 0
    for day_ns in np.unique(samples.time_ns // DAY_NS * DAY_NS).tolist():
        day = samples.between(day_ns, day_ns + DAY_NS)
        known = store.samples(station, day_ns, day_ns + DAY_NS)
        new += store.write(Batch(samples=day.select(~np.isin(day.time_ns, known.time_ns)).rows(station)))
    return len(recording), new
