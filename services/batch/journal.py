"""What a batch has done already: a file of JSON lines beside its results, for the run that follows a killed one."""

import contextlib
import fcntl
import hashlib
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, TextIO

from wetwell.protocols.errors import ConfigError, RecordingError


class Journal:
    """Lines of an earlier run, and those that this one adds; each is on disk when `add` returns."""

    def __init__(self, file: TextIO) -> None:
        self._file = file
        self.lines: list[dict[str, Any]] = []
        file.seek(0)
        for text in file:
            with contextlib.suppress(ValueError):  # the last line of a run that was killed
                self.lines.append(json.loads(text))

    def begin(self, lines: Iterable[dict[str, Any]]) -> None:
        """Keep these lines and no others."""
        text = "".join(map(_line, lines))
        self._file.seek(0)
        self._file.truncate()
        self._file.write(text)
        self._file.flush()

    def add(self, line: dict[str, Any]) -> None:
        """Add a line."""
        self._file.write(_line(line))
        self._file.flush()


@contextlib.contextmanager
def open_journal(path: Path, what: str) -> Iterator[Journal]:
    """The journal of a folder, which is made where it is missing, locked against a second run.

    An empty journal is removed at the end, and so is a folder that has nothing else.

    Raises
    ------
    ConfigError
        If another run holds it; `what` says what it makes.
    RecordingError
        If it cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"{path.parent}: cannot be written: {error.strerror or error}") from error
    try:
        with path.open("a+", encoding="utf-8") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise ConfigError(f"{path.parent}: another run makes this {what}") from None
            try:
                yield Journal(file)
            finally:
                if path.exists() and path.stat().st_size == 0:
                    path.unlink()
                    with contextlib.suppress(OSError):
                        path.parent.rmdir()  # nothing came of it
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {error.strerror or error}") from error


def fingerprint(*values: object) -> str:
    """Name of what JSON makes of some values: the same for the same, on every machine."""
    return hashlib.sha256(json.dumps(values, sort_keys=True, default=str).encode()).hexdigest()


def _line(value: dict[str, Any]) -> str:
    return json.dumps(value) + "\n"
