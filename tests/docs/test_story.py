"""The lines of `wetwell up` that pages show are those of the demo; verdicts are the same live and on a recording."""

import re
from pathlib import Path

import pytest

import wetwell
from wetwell.services.reports.terminal import StateLines

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "README.md", ROOT / "docs" / "tutorial-first-fault.md")
SHOWN = re.compile(r"^ *(\d{4}-\S+Z +pump .*)$", re.MULTILINE)


@pytest.mark.check
def test_the_verdicts_that_pages_show_are_those_of_the_demo() -> None:
    found = wetwell.detect(wetwell.simulate("alpha", "demo", seed=1), "alpha")
    lines = StateLines(("1", "2", "3"))
    told = [lines.line(verdict) for verdict in found.verdicts]
    shown = [line for page in PAGES for line in SHOWN.findall(page.read_text(encoding="utf-8"))]
    assert len(shown) > len(PAGES)
    assert [line for line in shown if line not in told] == []
