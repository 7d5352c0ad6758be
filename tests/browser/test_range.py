"""One time range for the whole station page: what it shows, how it is left again, what it gives out."""

import re
from urllib.parse import parse_qs, urlsplit

import pytest
from browser_site import rows_taken_along
from playwright.sync_api import expect

from wetwell.protocols.recordings.recording import read_recording
from wetwell.protocols.timestamps import from_iso

pytestmark = pytest.mark.check

POINTS = re.compile(r"\d{2,} points")
TRENDS = "charts.filter((each) => each.root.isConnected && each.root.closest('.trends'))"
"""Charts that are seen: first the lanes of verdicts and alarms, then the level."""
DRAWN = f"{TRENDS}[1].data[1].filter((value) => value !== null).length"
HAS_RED = """() => {
  const canvas = document.querySelector(".trends canvas");
  const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  for (let place = 0; place < data.length; place += 4)
    if (data[place] > 150 && data[place + 1] < 60 && data[place + 2] < 70) return true;
  return false;
}"""


def drag(page, first, last):
    over = page.locator(".is-trends .u-over").nth(1)
    over.hover()  # scrolls, and again where the chart was made anew meanwhile
    box = over.bounding_box()
    page.mouse.move(box["x"] + first * box["width"], box["y"] + 0.5 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + last * box["width"], box["y"] + 0.5 * box["height"], steps=5)
    page.mouse.up()


def test_a_span_fills_every_panel_and_dragging_zooms_and_back_undoes_it(site, open_page, tmp_path) -> None:
    page = open_page(f"{site.url}/station/alpha?pump=2")
    expect(page.locator("#station-time")).to_have_text(re.compile("[0-9]{4}-"))
    page.get_by_role("button", name="24 h").click()
    note = page.locator("#trend-note")
    expect(note).to_have_text(POINTS)
    assert page.evaluate(DRAWN) > 10
    expect(page.locator(".is-kpi table")).to_contain_text("Pump 2")
    drag(page, 0.5, 0.95)
    expect(page).to_have_url(re.compile("from=.*&to="))
    expect(note).to_have_text(POINTS)
    span = {name: values[0] for name, values in parse_qs(urlsplit(page.url).query).items()}
    with page.expect_download() as download:
        page.get_by_role("link", name="download as recording").click()
    path = tmp_path / download.value.suggested_filename
    download.value.save_as(path)
    recording = read_recording(path)
    assert from_iso(span["from"]) <= recording.time_ns[0] < recording.time_ns[-1] <= from_iso(span["to"]) + 1_000_000
    assert len(recording.time_ns) > 1000
    assert recording.pumps == 3
    rows = rows_taken_along(page, page.locator(".is-trends"), tmp_path)
    assert len(rows) == page.evaluate(f"{TRENDS}[1].data[0].length")
    assert {"level_m", "pump2_flow_m3h"} <= rows[0].keys()
    page.get_by_role("button", name="Back", exact=True).click()
    expect(page).not_to_have_url(re.compile("from="))
    expect(page.get_by_role("button", name="24 h")).to_have_attribute("aria-pressed", "true")


@pytest.mark.long
def test_a_moment_of_the_past_shows_plane_well_and_evidence_of_that_time(site, open_page) -> None:
    page = open_page(f"{site.url}/station/alpha?pump=2")
    expect(page.locator(".curve.now.fault")).to_have_count(1)
    healthy = "2025-01-01T06:55:00.000Z"  # five minutes before the blockage begins
    page.goto(f"{site.url}/station/alpha?pump=2&from=2025-01-01T04:00:00Z&to=2025-01-01T08:00:00Z&at={healthy}")
    expect(page.locator("#plane-words")).to_contain_text("At 2025-01-01 06:55:00")
    expect(page.locator(".trail path").first).to_have_attribute("d", re.compile("^M"))
    expect(page.locator(".curve.now.fault")).to_have_count(0)
    expect(page.locator(".pump").nth(1)).to_have_attribute("data-state", re.compile("normal|learning"))
    expect(page.locator(".is-well h2")).to_contain_text("at 2025-01-01 06:55:00")
    expect(page.locator(".is-trends .readout")).to_contain_text("pump 2: level")
    page.get_by_role("button", name="look at the end again").click()
    expect(page).not_to_have_url(re.compile("at="))
    expect(page.locator(".pump").nth(1)).to_have_attribute("data-state", "pump_fault")
    expect(page.locator(".curve.now.fault")).to_have_count(1)


@pytest.mark.long
def test_bands_tell_the_fault_and_the_list_of_changes_leads_to_its_moment(site, open_page) -> None:
    page = open_page(f"{site.url}/station/alpha?pump=2&from=2025-01-01T04:00:00Z&to=2025-01-01T09:00:00Z")
    expect(page.locator("#trend-note")).to_have_text(POINTS)
    page.wait_for_function(HAS_RED)
    page.get_by_text("Changes of state", exact=True).click()
    changes = page.get_by_role("list", name="Changes of state, newest first")
    changes.get_by_role("button", name="Pump 2 pump fault").last.click()
    expect(page).to_have_url(re.compile("at=2025-01-01T07"))
    expect(page.locator(".sentence")).to_contain_text("Pump 2 is at fault since 2025-01-01 07:")
    page.goto(f"{site.url}/station/alpha?pump=2&from=2025-01-01T04:00:00Z&to=2025-01-01T06:55:00Z")
    expect(page.locator("#trend-note")).to_have_text(POINTS)
    expect(page.locator(".is-alarms table caption")).to_have_text(
        "Alarms of the range"
    )  # the level is always too high
    assert page.locator(".is-alarms table").nth(1).locator("tbody tr").count() == 1


@pytest.mark.long
def test_dates_give_a_range_and_a_wrong_order_is_refused(site, open_page) -> None:
    page = open_page(f"{site.url}/station/alpha", timezone_id="Europe/Berlin")
    expect(page.locator("#station-time")).to_have_text(re.compile(r"(MEZ|CET|GMT\+1)"))
    page.get_by_label("from", exact=True).fill("2025-01-01T06:00:00")
    page.get_by_label("to", exact=True).fill("2025-01-01T05:00:00")
    page.get_by_role("button", name="show", exact=True).click()
    assert "from=" not in page.url
    page.get_by_label("to", exact=True).fill("2025-01-01T07:00:00")
    page.get_by_role("button", name="show", exact=True).click()
    expect(page).to_have_url(re.compile("from=2025-01-01T05%3A00%3A00.000Z&to=2025-01-01T06%3A00%3A00.000Z"))
    expect(page.locator("#trend-note")).to_contain_text("2025-01-01 06:00:00 to 2025-01-01 07:00:00")
    page.get_by_label("Times").select_option("utc")
    expect(page.locator("#trend-note")).to_contain_text("2025-01-01 05:00:00 to 2025-01-01 06:00:00 UTC")


def test_the_page_speaks_german_where_the_browser_does(site, open_page) -> None:
    page = open_page(f"{site.url}/station/alpha?pump=2", locale="de-DE")
    expect(page.locator("#station-state")).to_have_text("Pumpenfehler")
    expect(page.locator(".sentence")).to_contain_text("Pumpe 2 ist fehlerhaft seit")
    expect(page.locator(".sentence")).to_contain_text(re.compile(r"\d+,\d %"))
    assert page.locator("html").get_attribute("lang") == "de"
    page.get_by_label("Sprache").select_option("en")
    expect(page.locator("#station-state")).to_have_text("pump fault")
