"""What is not good is never drawn as if it were: a dead PLC, dead services, a station that is not there."""

import re

import httpx
import pytest
from playwright.sync_api import expect

pytestmark = pytest.mark.check

INK = """nodes => nodes.filter(node => {
  const ink = getComputedStyle(document.body).color;
  const style = getComputedStyle(node);
  const shown = node instanceof SVGElement ? style.fill : style.color;
  return node.textContent.trim() && node.checkVisibility() && shown === ink;
}).map(node => node.textContent.trim())"""
"""Texts that stand in full ink."""


def test_when_the_plc_dies_nothing_goes_on_in_black_and_absent_services_are_said(clogged_site, open_page) -> None:
    site = clogged_site
    page = open_page(f"{site.url}/station/alpha", may_lose_its_server=True)
    expect(page.locator(".pump.runs").first).to_be_visible()
    expect(page.locator(".well .water")).to_have_attribute("data-quality", "good")
    # A fault of the main is the main's: its pumps stay calm.
    expect(page.locator(".well .main.fault")).to_have_count(1, timeout=150_000)
    expect(page.locator("#station-state")).to_have_text("system fault")
    expect(page.locator(".cause")).to_have_text([re.compile("^rising main: ")])
    expect(page.locator(".pump.fault")).to_have_count(0)
    colours = page.locator(".well .main .pipe, .pump circle").evaluate_all(
        "nodes => nodes.map(node => getComputedStyle(node).stroke)"
    )
    assert colours[0] not in colours[1:]

    site.kill("simulator")
    expect(page.locator("#station-state")).to_have_text("no data")
    expect(page.locator("#station-time")).to_contain_text("old, ")
    expect(page.locator(".well")).to_have_attribute("data-quality", "old")
    expect(page.locator('.is-well .absent[data-service="source"]')).to_be_visible()
    expect(page.locator(".trends")).to_have_attribute("data-quality", "old")
    expect(page.locator(".plane")).to_have_attribute("data-quality", "old")
    assert page.locator(".well text:not(.limit text), #plane-words, .sentence, #station-time").evaluate_all(INK) == []
    assert (
        page.locator(".pump .impeller").evaluate_all(
            "nodes => nodes.filter(node => getComputedStyle(node).animationName !== 'none').length"
        )
        == 0
    )
    told = page.locator("#station-time").inner_text()
    expect(page.locator("#station-time")).not_to_have_text(told)  # the age goes on

    overview = open_page(site.url, may_lose_its_server=True)
    line = overview.get_by_role("row").filter(has_text="alpha")
    expect(line.locator(".state").first).to_have_text("no data")
    expect(line.locator(".gauge .value")).to_have_attribute("data-quality", "old")

    for name, place in {"detector": ".is-cause", "alarms": ".is-alarms", "historian": ".is-trends"}.items():
        away = page.locator(f'{place} .absent[data-service="{name}"]')
        expect(away).to_be_hidden()
        site.kill(name)
        expect(away).to_be_visible()
    page.reload()
    expect(page.locator('.is-alarms .absent[data-service="alarms"]')).to_be_visible()
    expect(page.get_by_text("No alarm.")).to_be_hidden()
    expect(page.locator('.is-kpi .absent[data-service="historian"]')).to_be_visible()

    site.kill("dashboard")
    expect(page.locator("#link")).to_have_text("connection lost, trying again")
    expect(page.locator("#station-time")).to_contain_text("no connection to the server")


def test_a_station_that_is_not_there_is_not_found(site, open_page) -> None:
    address = f"{site.url}/station/nowhere"
    assert httpx.get(address).status_code == 404
    assert httpx.get(f"{site.url}/api/stations/nowhere").status_code == 404
    page = open_page(address, may_lose_its_server=True)  # a browser tells its console of each 404
    expect(page.get_by_role("alert")).to_contain_text("There is no station nowhere")
    expect(page.locator(".panel").first).to_be_hidden()
    page.get_by_role("link", name="All stations").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Stations")
    expect(page.get_by_role("link", name="alpha")).to_be_visible()
    assert httpx.get(f"{site.url}/station/alpha").status_code == 200
