"""Rows that could not be read: how many for each reason, and the first of them."""

from pathlib import Path

from wetwell.protocols.arrays import Integers

_LONGEST = 60
"""Characters of a value that are shown."""


class Refusals:
    """What could not be read, by reason, in the order in which the reasons came up."""

    def __init__(self) -> None:
        self._counts: dict[str, int] = {}
        self._firsts: dict[str, str] = {}

    def add(self, reason: str, path: Path, lines: Integers, first: str) -> None:
        """Count the rows that stand in some lines of a file; `first` is what stands in the first of them."""
        if len(lines):
            self._counts[reason] = self._counts.get(reason, 0) + len(lines)
            shown = first if len(first) <= _LONGEST else first[:_LONGEST] + "..."
            self._firsts.setdefault(reason, f"{path}, line {int(lines[0])}: {shown!r}")

    @property
    def rows(self) -> int:
        """Rows of all reasons."""
        return sum(self._counts.values())

    def table(self) -> list[dict[str, object]]:
        """One row a reason: how many, why, and the first."""
        return [{"rows": count, "why": why, "first": self._firsts[why]} for why, count in self._counts.items()]
