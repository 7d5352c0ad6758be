"""The watch of one station: its state, the span that is due, and a look at it."""

import logging
from collections.abc import Collection, Sequence
from pathlib import Path

from wetwell.protocols.messages.gap_watch import GapWatch
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.services.watch.state_file import WatchFile
from wetwell.services.watch.words import message_of
from wetwell.sim2real.diagnosis.diagnosis import Diagnosis
from wetwell.sim2real.recording.preparation import Preparation, prepare
from wetwell.sim2real.watch.agreement import ToldFault
from wetwell.sim2real.watch.naming import Diagnose
from wetwell.sim2real.watch.spans import looked_over, refused, span_due
from wetwell.sim2real.watch.state import WatchState
from wetwell.sim2real.watch.watching import diagnosed_plainly, watched

log = logging.getLogger(__name__)


class StationWatcher:
    """Keeps the watch of a station, and its file. Synchronous.

    Parameters
    ----------
    station : Station
    folder : Path or None
        Of the state; without it nothing is kept.
    diagnosed : callable
        Diagnoses where the gap has changed.

    Raises
    ------
    ConfigError
        If the folder cannot be used.
    """

    def __init__(self, station: Station, folder: Path | None, diagnosed: Diagnose = diagnosed_plainly) -> None:
        self.station = station
        self.looks = self.diagnoses = 0
        self._diagnosed = diagnosed
        self._file = WatchFile(folder, station)
        self.state = self._file.load()

    @property
    def message(self) -> GapWatch | None:
        """What is told of the station; None before its first look."""
        return message_of(self.state)

    @property
    def write_errors(self) -> int:
        """Writes of the state that have failed in a row."""
        return self._file.errors

    def due(self, first_ns: int, newest_ns: int) -> tuple[int, int] | None:
        """Span to look at next; None while it is not yet over."""
        return span_due(self.state, first_ns, newest_ns)

    def look(self, span: tuple[int, int], recording: Recording | None, faults: Sequence[ToldFault]) -> None:
        """Look at a span, of which there may be no rows, and keep what comes of it."""
        self.state = self._after(span, recording, faults)
        if self.state.refused:
            log.info("station '%s': not looked at: %s", self.station.name, self.state.refused)
        self._file.save(self.state)

    def _after(self, span: tuple[int, int], recording: Recording | None, faults: Sequence[ToldFault]) -> WatchState:
        begins_ns, ends_ns = span
        if recording is None:
            return refused(self.state, begins_ns, ends_ns, 0, "nothing was recorded")
        try:
            rows, _ = prepare(recording, Preparation())
            state = watched(self.state, rows, faults, self._counted)
        except ValueError as error:
            return refused(self.state, begins_ns, ends_ns, len(recording), str(error))
        self.looks += 1
        return looked_over(state, ends_ns)

    def _counted(self, recording: Recording, station: Station, only: Collection[str] | None) -> Diagnosis:
        self.diagnoses += 1
        return self._diagnosed(recording, station, only)
