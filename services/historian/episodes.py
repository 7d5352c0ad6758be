"""Episodes of all stations as the historian keeps them: a row at each beginning, end and change."""

from collections.abc import Iterable

from wetwell.detector.verdict.episodes import EpisodeLog, episodes_of
from wetwell.protocols.messages.history import LONGEST_NS, Episode
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.historian.changes import verdicts_of_before
from wetwell.services.historian.store.interface import EventRow, Store, StoreError

LAST_ROWS = 5_000
"""Rows of a station that are looked through for its episodes: some a fault."""
LAST_VERDICTS = 20_000
"""Verdicts that are gathered to episodes where none were kept, as by earlier versions: of about a month."""


class EpisodeKeeper:
    """Gathers verdicts to episodes, and goes on where the store ends.

    Parameters
    ----------
    store : Store
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self._logs: dict[str, EpisodeLog] = {}

    def rows(self, verdict: Verdict) -> list[EventRow]:
        """Rows to keep after a verdict."""
        log = self._logs.get(verdict.station)
        if log is None:
            log = self._logs[verdict.station] = self._log(verdict.station)
        return [EventRow("episodes", episode.station, episode.time, episode.encode()) for episode in log.add(verdict)]

    def _log(self, station: str) -> EpisodeLog:
        try:
            standing = [episode for episode in kept_episodes(self._store, station) if episode.to is None]
            last = self._store.events("verdicts", station, -LONGEST_NS, LONGEST_NS, 1)
        except StoreError:
            return EpisodeLog()
        return EpisodeLog(standing, Verdict.decode(last[-1]).time if last else None)


def kept_episodes(store: Store, station: str) -> list[Episode]:
    """Episodes of a station as they were kept last, the first to begin first."""
    rows = map(Episode.decode, store.events("episodes", station, -LONGEST_NS, LONGEST_NS, LAST_ROWS))
    found = {(episode.asset, episode.since): episode for episode in rows}
    return sorted(found.values(), key=lambda episode: episode.since)


def episodes_between(store: Store, station: str, start_ns: int, end_ns: int) -> list[Episode]:
    """Episodes that reach into a span; gathered from the verdicts of earlier versions where none were kept."""
    found: Iterable[Episode] = kept_episodes(store, station)
    if not found:
        payloads = verdicts_of_before(store, station, start_ns, end_ns, LAST_VERDICTS)
        found = episodes_of(map(Verdict.decode, payloads))
    return [one for one in found if one.since < end_ns and (one.to is None or one.to >= start_ns)]
