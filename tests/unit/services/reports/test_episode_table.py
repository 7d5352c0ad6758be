"""Episodes as a page: well-formed, one bar an episode, in the span that was judged."""

import re
from xml.etree import ElementTree as ET

import pytest

from wetwell.protocols.messages.history import Episode
from wetwell.protocols.messages.verdict import Severity
from wetwell.services.reports.episode_table import episode_page, episode_rows

DAY_NS = 86_400 * 10**9


def episode(asset, since, to, stage="act"):
    severity = Severity(quantity="friction_rise_percent", value=16.0, interval=(15.0, 17.0), limit=15.0)
    fields = {"time": since, "station": "<s>", "asset": asset, "state": "system_fault", "stage": stage}
    return Episode.model_validate(fields | {"from": since, "to": to, "severity": severity, "advice": "flush & wait"})


def body(text):
    return ET.fromstring(text.removeprefix("<!DOCTYPE html>\n"))  # noqa: S314 - our own page


@pytest.mark.parametrize("count", [0, 1, 3])
def test_a_page_is_well_formed_and_has_a_bar_an_episode(count):
    episodes = [episode(f"main:{place % 2}", place * DAY_NS, (place + 1) * DAY_NS) for place in range(count)]
    page = episode_page("<s>", episodes, 0, 5 * DAY_NS)
    body(page)
    assert len(re.findall(r'<rect class="bar"', page)) == count
    assert ("No fault was told." in page) == (count == 0)


def test_what_began_before_and_what_stands_is_drawn_to_the_edges():
    page = episode_page("s", [episode("main", -DAY_NS, None)], 0, DAY_NS)
    (x, width) = re.search(r'<rect class="bar" x="([\d.]+)" y="\d+" width="([\d.]+)"', page).groups()
    assert (float(x), float(x) + float(width)) == (64.0 + 130.0, 760.0 - 36.0)


def test_a_row_says_what_stands_and_names_no_cost_that_is_not_known():
    (row,) = episode_rows([episode("main", 0, None)])
    assert (row["to"], row["cost"], row["severity"]) == (
        "stands",
        "",
        "friction 16 % (15 to 17), limit 15 %",
    )
