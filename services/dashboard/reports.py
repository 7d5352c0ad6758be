"""Reports that lie in a folder of the site, such as those of `wetwell gap diagnose`."""

import contextlib
from datetime import UTC, datetime
from pathlib import Path

from wetwell.services.dashboard.refusal import RefusalError

SUFFIX = ".html"
DEEPEST = 3
"""Folders below that of the settings in which reports are looked for."""


def report_names(folder: Path | None) -> dict[str, object]:
    """Pages in a folder, newest first, or why there are none."""
    if folder is None:
        return {"reports": [], "reason": "the setting dashboard.reports names no folder of HTML reports"}
    if not folder.is_dir():
        return {"reports": [], "reason": f"dashboard.reports: there is no folder '{folder}'"}
    found = [
        (path.stat().st_mtime, path.relative_to(folder).as_posix())
        for depth in range(DEEPEST + 1)
        for path in folder.glob("*/" * depth + f"*{SUFFIX}")
        if path.is_file() and path.resolve().is_relative_to(folder.resolve())
    ]
    reports = [
        {"name": name, "time": datetime.fromtimestamp(time_s, UTC).isoformat(timespec="seconds")}
        for time_s, name in sorted(found, reverse=True)
    ]
    return {"reports": reports, "reason": "" if reports else f"no *{SUFFIX} in '{folder}'"}


def find_report(folder: Path | None, name: str) -> Path:
    """Page of this name.

    Raises
    ------
    RefusalError
        If there is none in the folder.
    """
    if folder is not None:
        with contextlib.suppress(ValueError, OSError):  # no file can have such a name: a zero byte, or too long
            path = (folder / name).resolve()
            if path.suffix == SUFFIX and path.is_file() and path.is_relative_to(folder.resolve()):
                return path
    raise RefusalError(404, f"no report '{name}'")
