"""Which daily files there must be, and what each holds: a chain of lines a station, so that a missing day shows.

The file `days/NAME-days.jsonl` gets a line with the SHA-256 of a daily file when that is written, and one before it
is deleted. Files of an earlier version come into it when they are looked through for the first time.
"""

import contextlib
import logging
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Literal

from wetwell.protocols.errors import RecordingError
from wetwell.protocols.timestamps import to_iso
from wetwell.services.historian.store.interface import StoreError
from wetwell.services.runtime.clock import now_ns
from wetwell.services.security.audit_chain import damage_in, end_of, entries_of, whole_entries_of
from wetwell.services.security.chain_file import ChainFile
from wetwell.services.security.file_sum import file_sum

log = logging.getLogger(__name__)

Act = Literal["write", "find", "delete", "put aside", "lose"]
_SUFFIX = "-days.jsonl"


class DayLedger:
    """The ledgers of a folder of daily files.

    Parameters
    ----------
    folder : Path
        That has the daily files.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._chains: dict[str, ChainFile] = {}

    def stations(self) -> list[str]:
        """Stations that have a ledger, or the end of one."""
        ends = (path.with_suffix(".jsonl") for path in (self._folder / "days").glob("*-days.end"))
        return sorted({path.name.removesuffix(_SUFFIX) for path in [*ends, *self._folder.glob(f"days/*{_SUFFIX}")]})

    def note(self, station: str, act: Act, file: Path) -> None:
        """Write down that a file was written or found, or that it goes.

        Raises
        ------
        StoreError
            If it cannot be written, or the file cannot be read.
        """
        entry: dict[str, object] = {"act": act, "file": self._name(file)}
        try:
            if act in {"write", "find"}:
                entry["sha256"] = file_sum(file)
            self._append(station, entry)
        except OSError as error:
            raise StoreError(f"{self._path(station)}: cannot be written: {error.strerror or error}") from error

    def expected(self, station: str) -> dict[Path, str]:
        """Files that must be there, with their SHA-256."""
        return self._expected(entries_of(self._path(station)))

    def put_aside_damaged(self, station: str) -> list[str]:
        """Put the ledger of a station aside if it is not what was written; what is wrong with it.

        A new one begins with what the lines say that are still what was written.

        Raises
        ------
        StoreError
            If it cannot be read or written.
        """
        path = self._path(station)
        try:
            damage = damage_in(path)
            if damage:
                expected = self._expected(whole_entries_of(path))
                for each in (path, end_of(path)):
                    with contextlib.suppress(FileNotFoundError):
                        each.replace(each.with_name(f"{each.name}.refused"))
                self._chains.pop(station, None)
                for file, sha256 in expected.items():
                    self._append(station, {"act": "find", "file": self._name(file), "sha256": sha256})
        except OSError as error:
            raise StoreError(f"{path}: cannot be put aside: {error.strerror or error}") from error
        return damage

    def missing(self, station: str) -> list[Path]:
        """Files that must be there and are not."""
        return [file for file in self.expected(station) if not file.exists()]

    def is_changed(self, station: str, file: Path) -> bool:
        """Whether a file is another one than was written; one that nobody has noted is not.

        Raises
        ------
        StoreError
            If it cannot be read.
        """
        expected = self.expected(station).get(file)
        try:
            return expected is not None and file_sum(file) != expected
        except OSError as error:
            raise StoreError(f"{file}: cannot be read: {error.strerror or error}") from error

    def damage(self, station: str, told_of: Collection[Path] = ()) -> list[str]:
        """What is wrong with the ledger of a station, and the files that are missing or others than were written.

        Of files that are `told_of` already nothing is said.
        """
        path = self._path(station)
        told = [f"{path}: {what}" for what in damage_in(path)]
        for file, expected in self.expected(station).items():
            if file in told_of:
                continue
            try:
                told += [] if file_sum(file) == expected else [f"{file}: is another one than was written"]
            except FileNotFoundError:
                told.append(f"{file}: is missing")
            except OSError as error:
                told.append(f"{file}: cannot be read: {error.strerror or error}")
        return told

    def _append(self, station: str, entry: dict[str, object]) -> None:
        path = self._path(station)
        path.parent.mkdir(exist_ok=True)
        try:
            self._chains.setdefault(station, ChainFile(path)).append({"time": to_iso(now_ns()), **entry})
        except RecordingError as error:
            raise StoreError(str(error)) from error

    def _expected(self, entries: Iterable[dict[str, object]]) -> dict[Path, str]:
        """Files that must be there by some lines."""
        sums: dict[Path, str] = {}
        for entry in entries:
            file = self._folder / str(entry.get("file", ""))
            if "sha256" in entry:
                sums[file] = str(entry["sha256"])
            else:
                sums.pop(file, None)
        return sums

    def _path(self, station: str) -> Path:
        return self._folder / "days" / f"{station}{_SUFFIX}"

    def _name(self, file: Path) -> str:
        return file.relative_to(self._folder).as_posix()
