"""A file of JSON objects, one a line, in a chain: only appended to, by one writer after the other."""

import errno
import fcntl
import io
import json
import logging
import os
from pathlib import Path

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import RecordingError
from wetwell.services.security.audit_chain import LINK, end_found, end_of, link_of

log = logging.getLogger(__name__)


class ChainFile:
    """Appends entries; one is on the disk when `append` returns.

    Characteristics: threads and processes may write to one file, one after the other · when the disk refuses:
    nothing of the line stays, and the writer hears it.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known: tuple[int, str] | None = None

    def append(self, entry: dict[str, object]) -> None:
        """Append an entry, and before it that lines are lost if they are.

        Raises
        ------
        RecordingError
            If the file cannot be written; names it and the reason.
        """
        try:
            with self._path.open("ab", buffering=0) as file:
                fcntl.flock(file, fcntl.LOCK_EX)
                self._append(file, entry)
        except OSError as error:
            raise RecordingError(f"{self._path}: cannot be written: {error.strerror or error}") from error

    def _append(self, file: io.FileIO, entry: dict[str, object]) -> None:
        path, size = self._path, os.fstat(file.fileno()).st_size
        known, self._known = self._known, None  # as long as it is not on the disk nobody knows
        link, is_lost = (known[1], False) if known is not None and known[0] == size else end_found(path)
        entries = [entry]
        if is_lost:
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


def _write_whole(file: io.FileIO, content: bytes) -> None:
    if file.write(content) != len(content):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    os.fsync(file.fileno())


def _ends_with_newline(path: Path) -> bool:
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - 1, 0))
        return size == 0 or file.read(1) == b"\n"
