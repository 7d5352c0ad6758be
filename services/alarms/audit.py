"""The audit of alarms: who has done what to which alarm, one JSON object a line, never changed afterwards.

Each line ends with a link: the SHA-256 of the link before and of the line itself. A line that is changed, missing or
put in shows. The last link also stands in a file of its own, so that lines that were cut off at the end show too.
"""

import hashlib
import json
import logging
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Protocol

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import RecordingError
from wetwell.protocols.timestamps import to_iso

log = logging.getLogger(__name__)

LINK = "link"


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
        entry = None if last is None else _entry(last)
        self._link = "" if entry is None else str(entry.get(LINK, ""))
        self._keep = keep

    def write(self, now_ns: int, **fields: object) -> None:
        """Write an act down."""
        entry: dict[str, object] = {"time": to_iso(now_ns), **fields}
        log.info("audit: %s", json.dumps(entry, ensure_ascii=False))
        self._link = link_of(self._link, entry)
        self._keep(json.dumps(entry | {LINK: self._link}, ensure_ascii=False))


class Audit:
    """Append-only file of acts; a line is on the disk when `write` returns. Without a folder acts are only logged."""

    def __init__(self, folder: Path | None) -> None:
        self.path = None if folder is None else folder / "alarm-audit.jsonl"
        self._link: str | None = None

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
            if self._link is None:
                self._link = _last_link(self.path)
                if is_cut_off(self.path):
                    log.error("%s: lines at its end are lost", self.path)
                    self._append(
                        self.path, {"time": entry["time"], "act": "found that lines before this one are lost"}
                    )
            self._append(self.path, entry)
        except OSError as error:
            raise RecordingError(f"{self.path}: cannot be written: {error.strerror or error}") from error

    def _append(self, path: Path, entry: dict[str, object]) -> None:
        self._link, before = None, self._link or ""  # as long as it is not on the disk nobody knows
        link = link_of(before, entry)
        line = json.dumps(entry | {LINK: link}, ensure_ascii=False)
        is_new = not path.exists()
        with path.open("ab") as file:
            start = b"" if is_new or _ends_with_newline(path) else b"\n"  # a power cut left half a line
            file.write(start + line.encode() + b"\n")
            file.flush()
            os.fsync(file.fileno())
        with atomic_file(end_of(path)) as file:
            file.write(link.encode())
        self._link = link


def end_of(path: Path) -> Path:
    """File that holds the last link of an audit."""
    return path.with_suffix(".end")


def is_cut_off(path: Path) -> bool:
    """Whether the audit does not reach to the link that was written down as its last one.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    try:
        end = end_of(path).read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        return False  # of an earlier version, or of an audit that has not begun
    return end not in _links(path)


def link_of(before: str, entry: dict[str, object]) -> str:
    """Link of a line, from that of the line before, empty for the first.

    Examples
    --------
    >>> link_of("", {"act": "acknowledge"})[:8], link_of("1", {"act": "acknowledge"})[:8]
    ('710605c2', '36cdea25')
    """
    text = json.dumps(entry, ensure_ascii=False, sort_keys=True)
    return hashlib.sha256(f"{before}\n{text}".encode()).hexdigest()


def broken_lines(path: Path) -> list[int]:
    """Numbers, from 1, of lines that are damaged, or whose link does not follow from the line before.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    if not path.exists():
        return []
    return broken_among(path.read_text(encoding="utf-8", errors="replace").splitlines())


def broken_among(lines: Iterable[str]) -> list[int]:
    """Numbers, from 1, of lines that are damaged, or whose link does not follow from the line before.

    Lines without a link, of an earlier version, are passed over where none with one stands before them.
    """
    broken, before = [], ""
    for number, line in enumerate(lines, start=1):
        entry = _entry(line)
        link = None if entry is None else entry.pop(LINK, None)
        if entry is not None and link is None and not before:
            continue
        if entry is None or link != link_of(before, entry):
            broken.append(number)
        before = link if isinstance(link, str) else before
    return broken


def _entry(line: str) -> dict[str, object] | None:
    try:
        entry = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return entry if isinstance(entry, dict) else None


def _last_link(path: Path) -> str:
    """Link of the last line that has one; empty where none has."""
    links = _links(path)
    return links[-1] if links else ""


def _links(path: Path) -> list[str]:
    """Links of all lines that have one."""
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except FileNotFoundError:
        return []
    links = (entry.get(LINK) for entry in map(_entry, lines) if entry is not None)
    return [link for link in links if isinstance(link, str)]


def _ends_with_newline(path: Path) -> bool:
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - 1, 0))
        return size == 0 or file.read(1) == b"\n"
