"""The audit: who has done what, one JSON object a line, never changed afterwards, in a chain that shows a change."""

import errno
import fcntl
import io
import json
import logging
import os
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import RecordingError
from wetwell.protocols.timestamps import to_iso
from wetwell.services.security.audit_chain import (
    AUDIT_SUFFIX,
    LINK,
    end_of,
    entry_in,
    is_cut_off,
    last_link,
    link_of,
)

log = logging.getLogger(__name__)


class AuditTrail(Protocol):
    """Where acts are written down before they take effect."""

    def write(self, now_ns: int, **fields: object) -> None:
        """Write an act down.

        Raises
        ------
        RecordingError
            If it cannot be written.
        """


class LineAudit:
    """An audit whose lines, each with its link, go to somebody who keeps them with what they change.

    Parameters
    ----------
    last : str, optional
        The last line that is there.
    keep : callable
        Takes a line.
    """

    def __init__(self, last: str | None, keep: Callable[[str], None]) -> None:
        entry = None if last is None else entry_in(last)
        self._link = "" if entry is None else str(entry.get(LINK, ""))
        self._keep = keep

    def write(self, now_ns: int, **fields: object) -> None:
        """Write an act down."""
        entry: dict[str, object] = {"time": to_iso(now_ns), **fields}
        log.info("audit: %s", json.dumps(entry, ensure_ascii=False))
        self._link = link_of(self._link, entry)
        self._keep(json.dumps(entry | {LINK: self._link}, ensure_ascii=False))


class Audit:
    """Append-only file of acts; a line is on the disk when `write` returns. Without a path acts are only logged.

    Characteristics: threads and processes may write to one file, one after the other · when the disk refuses:
    nothing of the line stays, and the writer hears it.

    Parameters
    ----------
    path : Path, optional

    Attributes
    ----------
    errors : int
        How often the file could not be written.
    """

    def __init__(self, path: Path | None) -> None:
        self.path = path
        self.errors = 0
        self._known: tuple[int, str] | None = None

    def write(self, now_ns: int, **fields: object) -> None:
        """Write an act down.

        Raises
        ------
        RecordingError
            If the file cannot be written; names it and the reason.
        """
        entry = {"time": to_iso(now_ns), **fields}
        log.info("audit: %s", json.dumps(entry, ensure_ascii=False))
        if self.path is None:
            return
        try:
            with self.path.open("ab", buffering=0) as file:
                fcntl.flock(file, fcntl.LOCK_EX)
                self._append(file, self.path, entry)
        except OSError as error:
            self.errors += 1
            raise RecordingError(f"{self.path}: cannot be written: {error.strerror or error}") from error
        except RecordingError:
            self.errors += 1
            raise

    def note(self, now_ns: int, **fields: object) -> None:
        """Write down what has happened already, or what must go on; a disk that refuses is told in the log."""
        try:
            self.write(now_ns, **fields)
        except RecordingError as error:
            log.error("%s; not in the audit: %s", error, json.dumps(fields, ensure_ascii=False))  # noqa: TRY400

    def _append(self, file: io.FileIO, path: Path, entry: dict[str, object]) -> None:
        """Write a line, and before it that lines are lost if they are; `file` is held."""
        size, known, self._known = os.fstat(file.fileno()).st_size, self._known, None
        link = known[1] if known is not None and known[0] == size else last_link(path)
        entries = [entry]
        if known is None and is_cut_off(path):
            log.error("%s: lines at its end are lost", path)
            entries.insert(0, {"time": entry["time"], "act": "found that lines before this one are lost"})
        lines = []
        for each in entries:
            link = link_of(link, each)
            lines.append(json.dumps(each | {LINK: link}, ensure_ascii=False))
        start = b"" if _ends_with_newline(path) else b"\n"  # a power cut left half a line
        content = start + "\n".join(lines).encode() + b"\n"
        try:
            _write_whole(file, content)
            with atomic_file(end_of(path)) as end:
                end.write(link.encode())
        except (OSError, RecordingError):
            os.ftruncate(file.fileno(), size)
            raise
        self._known = (size + len(content), link)


def audit_in(folder: Path | None, of: str) -> Audit:
    """Audit of a daemon or of a kind of acts in a folder; without one acts are only logged."""
    return Audit(None if folder is None else folder / f"{of}{AUDIT_SUFFIX}")


def _write_whole(file: io.FileIO, content: bytes) -> None:
    if file.write(content) != len(content):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    os.fsync(file.fileno())


def _ends_with_newline(path: Path) -> bool:
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - 1, 0))
        return size == 0 or file.read(1) == b"\n"
