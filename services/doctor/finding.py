"""What the doctor found."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from wetwell.services.reports.text_table import folded

Level = Literal["ok", "warning", "error"]


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at: how it is, in plain words, and what to do about it."""

    check: str
    level: Level
    text: str
    advice: str = ""


def exit_code(findings: Sequence[Finding]) -> int:
    """0 if all is well, 1 with warnings, 2 with errors."""
    levels = {finding.level for finding in findings}
    return 2 if "error" in levels else 1 if "warning" in levels else 0


def finding_lines(findings: Sequence[Finding]) -> str:
    """Findings for people.

    Examples
    --------
    >>> print(finding_lines([
    ...     Finding("router", "ok", "the router answers"),
    ...     Finding("detector", "error", "station 'alpha': no detector is running", "wetwell detector")]))
    ok       router     the router answers
    ERROR    detector   station 'alpha': no detector is running
                        -> wetwell detector
    """
    lines = []
    for finding in findings:
        word = finding.level if finding.level == "ok" else finding.level.upper()
        lines.append(folded(f"{word:<7}  {finding.check:<9}  {finding.text}", hang=20))
        if finding.advice:
            lines.append(folded(f"{'':<20}-> {finding.advice}", hang=3))
    return "\n".join(lines)
