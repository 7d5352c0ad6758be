"""The pages on alarms and operations say what the code does."""

import re
from pathlib import Path

import pytest

from wetwell.detector.stream.gate import COUNTS
from wetwell.services.alarms.rules import RULES
from wetwell.services.alarms.service import AlarmService
from wetwell.services.alarms.station_clock import Now
from wetwell.services.alarms.tables import TARGETS
from wetwell.services.runtime.health.metrics import METRICS
from wetwell.services.runtime.settings import AlarmSettings

ROOT = Path(__file__).parents[2]
SOURCES = [
    *(ROOT / "detector").rglob("*.py"),
    *(path for path in (ROOT / "services").rglob("*.py") if {"alarms", "detector", "detector.py"} & {*path.parts}),
]


def rows(page: str, heading: str) -> list[list[str]]:
    """Rows of the table whose first heading this is."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    table = text.partition(f"| {heading} |")[2].partition("\n\n")[0].splitlines()[2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table]


def test_the_table_of_metrics_is_that_of_the_code():
    assert [[name.strip("`"), text] for name, text in rows("operations.md", "Figure")] == [
        [name, text] for name, text in sorted(METRICS.items())
    ]


def test_every_count_of_detector_and_alarms_has_its_meaning():
    counted = set(COUNTS) | {
        name for path in SOURCES for name in re.findall(r'counts\["(\w+)"\]', path.read_text(encoding="utf-8"))
    }
    assert {"samples", "malformed", "acts"} <= counted
    assert counted <= set(METRICS)


def test_every_figure_of_alarms_has_its_meaning():
    service = AlarmService(None, AlarmSettings(), (), lambda: Now(0, 0.0))
    assert set(service.figures()) | {"dropped"} <= set(METRICS)
    assert set(TARGETS) <= set(METRICS)


def test_the_table_of_rules_is_that_of_the_code():
    table = {row[0].strip("`"): row for row in rows("alarms.md", "Rule")}
    assert list(table) == list(RULES)
    for name, rule in RULES.items():
        delays = [f"{delay_s:g} s" if delay_s else "0" for delay_s in (rule.on_delay_s, rule.off_delay_s)]
        assert table[name][2].split(", ")[-1] == rule.priority
        assert table[name][4] == ", ".join(delays)
        assert (table[name][1] in {"pump", "main", "meter"}) == name.endswith("_fault")


@pytest.mark.parametrize("page", ["alarms.md", "operations.md"])
def test_settings_that_a_page_names_are_there(page):
    named = set(re.findall(r"`alarms\.(\w+)`", (ROOT / "docs" / page).read_text(encoding="utf-8")))
    assert named <= set(AlarmSettings.model_fields) | {"json", "refused"}
