"""Alarms and acts of people on the page: filters, several at once, the journal, what crews did."""

import re

import pytest
from browser_site import rows_taken_along
from playwright.sync_api import expect

pytestmark = pytest.mark.check


def test_several_alarms_are_acknowledged_with_a_comment_and_the_journal_tells_it(site, open_page) -> None:
    page = open_page(f"{site.url}/alarms?show=open")
    expect(page.get_by_role("row").filter(has_text="level high")).to_be_visible()
    expect(page.get_by_role("row").filter(has_text="pump 2")).to_be_visible(timeout=150_000)
    page.get_by_role("button", name="choose all to acknowledge").click()
    together = page.locator("#acknowledge-chosen")
    expect(together).to_have_text(re.compile(r"acknowledge [2-9] chosen"))
    together.click()
    page.get_by_label("Your name").fill("Ada")
    page.get_by_label("Comment").fill("crew is on its way")
    page.get_by_role("dialog").get_by_role("button", name="acknowledge").click()
    expect(page.get_by_role("row").filter(has_text="level high")).to_have_count(0)
    acts = [(act["alarm"], act["by"], act["reason"]) for act in site.acts]
    assert ("level_high", "Ada", "crew is on its way") in acts
    assert any(alarm.startswith("pump2.") for alarm, *_ in acts)
    page.get_by_role("button", name="journal").click()
    line = page.locator(".journal tbody tr").filter(has_text="crew is on its way").filter(has_text="level high")
    expect(line).to_have_count(1)
    expect(line).to_contain_text("acknowledged")
    expect(line).to_contain_text("Ada")


def test_shelved_alarms_are_listed_apart_and_filters_and_order_are_in_the_address(site, open_page) -> None:
    page = open_page(f"{site.url}/alarms")
    row = page.get_by_role("row").filter(has_text="level high")
    row.get_by_role("button", name="shelve").click()
    page.get_by_label("Your name").fill("Ada")
    page.get_by_label("Reason").fill("tank is cleaned")
    page.get_by_role("dialog").get_by_role("button", name="shelve").click()
    expect(row).to_have_count(0)
    page.get_by_role("button", name="shelved and out of service").click()
    expect(row).to_contain_text("shelved by Ada until")
    expect(row).to_contain_text("tank is cleaned")
    row.get_by_role("button", name="unshelve").click()
    page.get_by_role("dialog").get_by_role("button", name="unshelve").click()
    page.get_by_role("button", name="standing").click()
    expect(row).to_contain_text("unacknowledged")  # it calls anew, even if it was acknowledged before
    page.get_by_label("Priority").select_option("urgent")
    expect(page).to_have_url(re.compile("priority=urgent"))
    expect(page.get_by_text("No alarm.")).to_be_visible()
    page.get_by_label("Priority").select_option("")
    page.get_by_role("button", name="Raised").click()
    expect(page).to_have_url(re.compile("sort=raised"))
    expect(page.get_by_role("columnheader", name="Raised")).to_have_attribute("aria-sort", "descending")
    page.get_by_label("Find a station or an alarm").fill("no such thing")
    expect(page.get_by_text("No alarm.")).to_be_visible()


def test_an_act_of_a_crew_is_entered_and_stands_in_the_log(site, open_page) -> None:
    page = open_page(f"{site.url}/station/alpha?pump=2")
    panel = page.locator(".is-maintenance")
    panel.get_by_label("What").select_option("pump:2")
    panel.get_by_label("Done").select_option("pulled")
    panel.get_by_label("Found").fill("rags")
    panel.get_by_label("By", exact=True).fill("Ada")
    panel.get_by_role("button", name="enter the act").click()
    expect(panel.get_by_text("Entered.")).to_be_visible()
    line = panel.locator("tbody tr").filter(has_text="rags")
    expect(line).to_contain_text("pulled")
    expect(line).to_contain_text("Ada")


@pytest.mark.long
def test_an_episode_is_told_and_leads_to_its_time(site, open_page) -> None:
    page = open_page(f"{site.url}/station/alpha?pump=1")
    episode = page.locator(".episodes tbody tr").filter(has_text="pump 2")
    expect(episode.first).to_contain_text("2025-01-01 07:", timeout=150_000)
    episode.first.get_by_role("button").click()
    expect(page).to_have_url(re.compile("from=.*&to="))
    expect(page.get_by_role("button", name="Pump 2", exact=True)).to_have_attribute("aria-pressed", "true")


@pytest.mark.long
def test_the_overview_tells_cause_and_cost_and_on_a_phone_it_is_a_card(site, open_page) -> None:
    page = open_page(site.url)
    line = page.get_by_role("row").filter(has_text="alpha")
    expect(line).to_contain_text("pump 2", timeout=150_000)
    expect(line).to_contain_text(re.compile("watch|plan|act"))
    expect(line).to_contain_text("2025-01-01")
    phone = open_page(site.url, viewport={"width": 390, "height": 844})
    card = phone.get_by_role("row").filter(has_text="alpha")
    expect(card.get_by_text("pump 2", exact=True)).to_be_in_viewport(ratio=1.0)
    assert phone.evaluate("document.documentElement.scrollWidth") <= 390


@pytest.mark.long
def test_a_station_under_maintenance_says_so_on_every_page_until_it_is_back(site, open_page, axe) -> None:
    page = open_page(f"{site.url}/station/alpha")
    modes = page.get_by_role("group", name="Mode of the station")
    modes.get_by_role("button", name="under maintenance").click()
    page.get_by_label("Your name").fill("Ada")
    page.get_by_label("Reason").fill("pumps are pulled")
    page.get_by_role("dialog").get_by_role("button", name="under maintenance").click()
    try:
        mode = page.locator("#station-mode")
        expect(mode).to_have_text(re.compile("under maintenance by Ada, since 2025-.*: pumps are pulled"))
        expect(modes.get_by_role("button", name="under maintenance")).to_have_attribute("aria-pressed", "true")
        assert axe(page) == []
        overview = open_page(site.url)
        expect(overview.get_by_role("row").filter(has_text="alpha")).to_contain_text("under maintenance")
        assert axe(overview) == []
        overview.goto(f"{site.url}/alarms?show=aside")
        expect(overview.get_by_role("row").filter(has_text="under maintenance")).to_contain_text("pumps are pulled")
        expect(overview.get_by_role("row").filter(has_text="pump fault")).to_contain_text("suppressed by design")
    finally:
        modes.get_by_role("button", name="back in operation").click()
        page.get_by_role("dialog").get_by_role("button", name="back in operation").click()
    expect(mode).to_have_text("")
    expect(modes.get_by_role("button", name="back in operation")).to_have_attribute("aria-pressed", "true")


@pytest.mark.long
def test_the_dialog_of_an_act_can_be_used_by_everybody(site, open_page, axe) -> None:
    page = open_page(f"{site.url}/alarms")
    page.get_by_role("row").filter(has_text="level high").get_by_role("button", name="shelve").click()
    expect(page.get_by_role("dialog", name=re.compile("^shelve: level high"))).to_be_visible()
    assert axe(page) == []


@pytest.mark.long
def test_alarms_of_the_list_can_be_taken_along(site, open_page, tmp_path) -> None:
    page = open_page(f"{site.url}/alarms")
    expect(page.get_by_role("row").filter(has_text="level high")).to_be_visible()
    rows = {row["id"]: row for row in rows_taken_along(page, page, tmp_path)}
    assert (rows["level_high"]["station"], rows["level_high"]["priority"]) == ("alpha", "high")


@pytest.mark.long
def test_what_stands_at_a_station_can_be_taken_along_while_it_is_live(site, open_page, tmp_path) -> None:
    page = open_page(f"{site.url}/station/alpha")
    panel = page.locator(".is-alarms")
    expect(panel.get_by_role("row").filter(has_text="level high")).to_be_visible()
    rows = {row["alarm"]: row for row in rows_taken_along(page, panel, tmp_path)}
    assert rows["level_high"]["state"] in {"unacknowledged", "acknowledged", "returned"}


@pytest.mark.long
def test_episodes_and_energy_of_a_range_can_be_taken_along(site, open_page, tmp_path) -> None:
    page = open_page(f"{site.url}/station/alpha?span=24h")
    expect(page.locator(".episodes tbody tr").filter(has_text="pump 2").first).to_be_visible(timeout=150_000)
    expect(page.locator(".is-kpi table")).to_contain_text("Pump 2")
    episodes = rows_taken_along(page, page.locator(".is-episodes"), tmp_path)
    assert "pump:2" in [row["asset"] for row in episodes]
    assert rows_taken_along(page, page.locator(".is-kpi"), tmp_path)
