"""The audit of alarms: who has done what to which alarm, one JSON object a line, never changed afterwards."""

import json
import logging
import os
from pathlib import Path

from wetwell.protocols.errors import RecordingError
from wetwell.protocols.timestamps import to_iso

log = logging.getLogger(__name__)


class Audit:
    """Append-only file of acts; a line is on the disk when `write` returns. Without a folder acts are only logged."""

    def __init__(self, folder: Path | None) -> None:
        self.path = None if folder is None else folder / "alarm-audit.jsonl"

    def write(self, now_ns: int, **fields: object) -> None:
        """Write an act down.

        Raises
        ------
        RecordingError
            If the file cannot be written; names it and the reason.
        """
        line = json.dumps({"time": to_iso(now_ns), **fields}, ensure_ascii=False)
        log.info("audit: %s", line)
        if self.path is None:
            return
        try:
            is_new = not self.path.exists()
            with self.path.open("ab") as file:
                start = b"" if is_new or _ends_with_newline(self.path) else b"\n"  # a power cut left half a line
                file.write(start + line.encode() + b"\n")
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise RecordingError(f"{self.path}: cannot be written: {error.strerror or error}") from error


def _ends_with_newline(path: Path) -> bool:
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - 1, 0))
        return size == 0 or file.read(1) == b"\n"
