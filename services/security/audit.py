"""The audit: who has done what, one JSON object a line, never changed afterwards, in a chain that shows a change."""

import json
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from wetwell.protocols.errors import RecordingError
from wetwell.protocols.timestamps import to_iso
from wetwell.services.security.audit_chain import AUDIT_SUFFIX, LINK, entry_in, link_of
from wetwell.services.security.chain_file import ChainFile

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
    """A `ChainFile` of acts; a line is on the disk when `write` returns. Without a path acts are only logged.

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
        self._file = None if path is None else ChainFile(path)

    def write(self, now_ns: int, **fields: object) -> None:
        """Write an act down.

        Raises
        ------
        RecordingError
            If the file cannot be written; names it and the reason.
        """
        entry = {"time": to_iso(now_ns), **fields}
        log.info("audit: %s", json.dumps(entry, ensure_ascii=False))
        if self._file is None:
            return
        try:
            self._file.append(entry)
        except RecordingError:
            self.errors += 1
            raise

    def note(self, now_ns: int, **fields: object) -> None:
        """Write down what has happened already, or what must go on; a disk that refuses is told in the log."""
        try:
            self.write(now_ns, **fields)
        except RecordingError as error:
            log.error("%s; not in the audit: %s", error, json.dumps(fields, ensure_ascii=False))  # noqa: TRY400


def audit_in(folder: Path | None, of: str) -> Audit:
    """Audit of a daemon or of a kind of acts in a folder; without one acts are only logged."""
    return Audit(None if folder is None else folder / f"{of}{AUDIT_SUFFIX}")
