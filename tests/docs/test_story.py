"""The lines of `wetwell up` that pages show are those of the demo; verdicts are the same live and on a recording."""

import re
from pathlib import Path

import pytest

import wetwell
from wetwell.services.reports.terminal import StateLines, story_lines
from wetwell.services.supervisor.story import Story

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "README.md", ROOT / "docs" / "tutorial-first-fault.md")
SHOWN = re.compile(r"^```text\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PUMPS = ("1", "2", "3")


@pytest.mark.check
def test_what_pages_show_of_the_demo_is_what_it_says() -> None:
    found = wetwell.detect(wetwell.simulate("alpha", "demo", seed=1), "alpha")
    lines, story = StateLines(PUMPS), Story()
    told = [str(lines.line(verdict)) for verdict in found.verdicts]
    for verdict in found.verdicts:
        story.handle(verdict)
    told += story_lines(story.changes, story.length_s / 3600, PUMPS).splitlines()
    shown = [
        line
        for page in PAGES
        for block in SHOWN.findall(page.read_text(encoding="utf-8"))
        for line in block.splitlines()
    ]
    assert len(shown) > len(PAGES)
    assert [line for line in shown if line not in told] == []
