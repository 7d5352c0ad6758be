"""The chain of an audit: each line ends with a link, the SHA-256 of the link before and of the line itself.

A line that is changed, missing or put in shows. The last link also stands in a file of its own, so that lines that
were cut off at the end show too.
"""

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path

LINK = "link"
AUDIT_SUFFIX = "-audit.jsonl"


def link_of(before: str, entry: dict[str, object]) -> str:
    """Link of a line, from that of the line before, empty for the first.

    Examples
    --------
    >>> link_of("", {"act": "acknowledge"})[:8], link_of("1", {"act": "acknowledge"})[:8]
    ('710605c2', '36cdea25')
    """
    text = json.dumps(entry, ensure_ascii=False, sort_keys=True)
    return hashlib.sha256(f"{before}\n{text}".encode()).hexdigest()


def end_of(path: Path) -> Path:
    """File that holds the last link of an audit."""
    return path.with_suffix(".end")


def audits_in(folder: Path) -> list[Path]:
    """Audits of a folder, also those of which only the last link is left."""
    ends = [end.with_suffix(".jsonl") for end in folder.glob("*-audit.end")]
    return sorted({*folder.glob(f"*{AUDIT_SUFFIX}"), *ends})


def is_cut_off(path: Path) -> bool:
    """Whether the audit does not reach to the link that was written down as its last one.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    return end_found(path)[1]


def damage_in(path: Path) -> list[str]:
    """What is wrong with an audit: lines that are not what was written, and whether some at its end are lost.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    told = [f"line {number} is not what was written" for number in broken_lines(path)]
    return [*told, "lines at its end are lost"] if is_cut_off(path) else told


def broken_lines(path: Path) -> list[int]:
    """Numbers, from 1, of lines that are damaged, or whose link does not follow from the line before.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    if not path.exists():
        return []
    return broken_among(_lines(path))


def broken_among(lines: Iterable[str]) -> list[int]:
    """Numbers, from 1, of lines that are damaged, or whose link does not follow from the line before.

    Lines without a link, of an earlier version, are passed over where none with one stands before them.
    """
    broken, before = [], ""
    for number, line in enumerate(lines, start=1):
        entry = entry_in(line)
        link = None if entry is None else entry.pop(LINK, None)
        if entry is not None and link is None and not before:
            continue
        if entry is None or link != link_of(before, entry):
            broken.append(number)
        before = link if isinstance(link, str) else before
    return broken


def end_found(path: Path) -> tuple[str, bool]:
    """Link of the last line that has one, empty where none has, and whether lines behind it are lost.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    links = _links(path)
    try:
        end = end_of(path).read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        is_lost = False  # of an earlier version, or of an audit that has not begun
    else:
        is_lost = end not in links
    return links[-1] if links else "", is_lost


def entries_of(path: Path) -> list[dict[str, object]]:
    """What the lines of an audit say, but for damaged ones; nothing where it cannot be read."""
    return _entries(_lines_if_any(path))


def whole_entries_of(path: Path) -> list[dict[str, object]]:
    """What the lines of an audit say that are what was written; nothing where it cannot be read."""
    lines = _lines_if_any(path)
    broken = set(broken_among(lines))
    return _entries(line for number, line in enumerate(lines, start=1) if number not in broken)


def _entries(lines: Iterable[str]) -> list[dict[str, object]]:
    return [entry for entry in map(entry_in, lines) if entry is not None]


def _lines_if_any(path: Path) -> list[str]:
    try:
        return _lines(path)
    except OSError:
        return []


def _lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8", errors="replace").splitlines()


def entry_in(line: str) -> dict[str, object] | None:
    """What a line says; None if it is damaged."""
    try:
        entry = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return entry if isinstance(entry, dict) else None


def _links(path: Path) -> list[str]:
    """Links of all lines that have one."""
    if not path.exists():
        return []
    links = (entry.get(LINK) for entry in _entries(_lines(path)))
    return [link for link in links if isinstance(link, str)]
