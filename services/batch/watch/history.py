"""The watch of the gap over a history on disk, without a bus."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.messages.gap_watch import GapWatch
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.services.historian.episodes import episodes_between
from wetwell.services.historian.rows import QUALITIES
from wetwell.services.historian.samples import Samples, merged
from wetwell.services.historian.store.interface import Store, blocks
from wetwell.services.watch.station_watcher import StationWatcher
from wetwell.sim2real.watch.agreement import ToldFault
from wetwell.sim2real.watch.naming import Diagnose
from wetwell.sim2real.watch.watching import diagnosed_plainly


def watch_history(
    store: Store,
    station: Station,
    folder: Path | None,
    diagnosed: Diagnose = diagnosed_plainly,
    progress: Callable[[float], None] = lambda _: None,
) -> GapWatch | None:
    """Look at all that was kept of a station since its last look; what is told then, None where no look was possible.

    Parameters
    ----------
    store : Store
    station : Station
    folder : Path or None
        Where the state of the watch is kept; without it the whole history is looked at.
    diagnosed : callable
    progress : callable
        Gets the share of the spans that were looked at.

    Raises
    ------
    ConfigError
        If nothing was kept of the station, or the folder cannot be used.
    """
    span = store.station(station.name)
    newest_ns = store.newest_ns(station.name)
    if span is None or newest_ns is None:
        raise ConfigError(f"station '{station.name}': the history has no samples")
    watcher = StationWatcher(station, folder, diagnosed)
    while (due := watcher.due(span.first_ns, newest_ns)) is not None:
        watcher.look(due, _recording(store, station, *due), list(_faults(store, station.name, *due)))
        progress((due[1] - span.first_ns) / max(newest_ns - span.first_ns, 1))
    return watcher.message


def _recording(store: Store, station: Station, begins_ns: int, ends_ns: int) -> Recording | None:
    """Samples of a span that are not bad, one of each time; None without any."""
    parts: list[Samples] = list(blocks(store, station.name, begins_ns, ends_ns))
    if not any(len(part) for part in parts):
        return None
    samples = merged(parts)
    is_kept = np.r_[True, np.diff(samples.time_ns) > 0] & (samples.quality != QUALITIES.index("bad"))
    return replace(samples.select(is_kept).recording(len(station.pump)), station=station.name)


def _faults(store: Store, station: str, begins_ns: int, ends_ns: int) -> Iterator[ToldFault]:
    for one in episodes_between(store, station, begins_ns, ends_ns):
        yield ToldFault(asset=one.asset, since_ns=one.since, to_ns=one.to)
