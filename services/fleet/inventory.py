"""The stations of a fleet: a folder of station files, or a table that names them."""

import csv
import logging
from pathlib import Path

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.station.station_file import Station
from wetwell.services.stations import find_station

log = logging.getLogger(__name__)


class Inventory:
    """Reads the stations, and again when a file has changed. One wrong file is told and left out; the rest goes on.

    Parameters
    ----------
    path : Path
        Folder of `*.toml`, or a CSV file with a column `station_file`, relative to its place.

    Raises
    ------
    ConfigError
        If there is no such folder or file, or it has no such column.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known: dict[Path, tuple[int, Station | None]] = {}
        self.wrong: dict[str, str] = {}
        self._files()

    def stations(self) -> dict[str, Station]:
        """Stations by name, as the files say now."""
        files = self._files()
        for gone in self._known.keys() - set(files):
            del self._known[gone]
        self.wrong = {name: reason for name, reason in self.wrong.items() if Path(name) in self._known}
        found: dict[str, Station] = {}
        for file in files:
            station = self._station(file)
            if station is None:
                continue
            if station.name in found:
                self._tell(file, f"station '{station.name}' is in the inventory twice")
            else:
                found[station.name] = station
        return found

    def _files(self) -> list[Path]:
        if self._path.is_dir():
            return sorted(self._path.glob("*.toml"))
        try:
            with self._path.open(newline="", encoding="utf-8") as table:
                rows = csv.DictReader(table)
                if "station_file" not in (rows.fieldnames or ()):
                    raise ConfigError(f"{self._path}: must have a column 'station_file'")
                return [self._path.parent / row["station_file"] for row in rows]
        except OSError as error:
            raise ConfigError(f"{self._path}: {error.strerror or error}") from error

    def _station(self, file: Path) -> Station | None:
        try:
            changed_ns = file.stat().st_mtime_ns
        except OSError as error:
            self._known[file] = (0, None)
            self._tell(file, error.strerror or str(error))
            return None
        if file not in self._known or self._known[file][0] != changed_ns:
            self._known[file] = (changed_ns, self._read(file))
        return self._known[file][1]

    def _read(self, file: Path) -> Station | None:
        try:
            station = find_station(str(file))
        except ConfigError as error:
            self._tell(file, str(error))
            return None
        self.wrong.pop(str(file), None)
        return station

    def _tell(self, file: Path, reason: str) -> None:
        if self.wrong.get(str(file)) != reason:
            log.error("inventory: %s", reason)
        self.wrong[str(file)] = reason
