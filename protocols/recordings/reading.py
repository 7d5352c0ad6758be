"""How a recording is taken up: the zone of stamps that have none, and the station that it has to be of."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.protocols.recordings.recording import Recording, read_recording
from wetwell.protocols.station.station_file import Station


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """What a command is told of the recordings that it reads.

    Attributes
    ----------
    time_zone : ZoneInfo, optional
        Of the clock whose stamps have no zone.
    as_station : bool
        Whether a recording is taken for one of the station that is given, whatever name it carries.
    """

    time_zone: ZoneInfo | None = None
    as_station: bool = False

    @classmethod
    def said(cls, time_zone: str | None, *, as_station: bool = False) -> Self:
        """What the flags say.

        Raises
        ------
        ConfigError
            If there is no such time zone.
        """
        try:
            zone = None if time_zone is None else ZoneInfo(time_zone)
        except (ZoneInfoNotFoundError, ValueError, OSError) as error:
            raise ConfigError(
                f"--time-zone: got '{time_zone}', must be the name of a zone such as Europe/Helsinki"
            ) from error
        return cls(time_zone=zone, as_station=as_station)

    @property
    def identity(self) -> tuple[str | None, bool]:
        """What JSON can hold of it."""
        return None if self.time_zone is None else self.time_zone.key, self.as_station

    def read(self, path: Path) -> Recording:
        """Recording in a file, of whatever station.

        Raises
        ------
        RecordingError
            As `read_recording`.
        """
        return read_recording(path, self.time_zone)

    def read_of(self, path: Path, station: Station) -> Recording:
        """Recording in a file that is one of a station; from now on it carries the station's name.

        Raises
        ------
        RecordingError
            As `read_recording`, and if it is of another station, or of another number of pumps.
        """
        return self.taken_for(self.read(path), station, path)

    def taken_for(self, recording: Recording, station: Station, place: Path | str) -> Recording:
        """The recording as one of a station, whose name it carries from now on.

        Raises
        ------
        RecordingError
            If it is of another station, or of another number of pumps.
        """
        self.name_for(recording, station.name, place)
        if recording.pumps != len(station.pump):
            raise RecordingError(
                f"{place}: has {recording.pumps} pumps, station '{station.name}' has {len(station.pump)}"
            )
        return replace(recording, station=station.name)

    def name_for(self, recording: Recording, station: str | None, place: Path | str) -> str:
        """Name of the station that a recording is of: the one that is given, or else its own.

        Raises
        ------
        RecordingError
            If the two contradict each other.
        ConfigError
            If neither is known.
        """
        name = recording.station if station is None else station
        if name is None:
            raise ConfigError(f"{place}: does not say its station: give --station")
        if not self.as_station and recording.station not in {None, name}:
            way = f"--as-station takes it for one of '{name}'"
            raise RecordingError(f"{place}: is of station '{recording.station}', not of '{name}' ({way})")
        return name


PLAIN = Reading()
"""Without any flag."""
