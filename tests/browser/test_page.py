"""The page in a real browser, over the real processes."""

import json
import re
import signal
from importlib.resources import files

import pytest
from playwright.sync_api import expect

from wetwell.services.security.tokens import new_token

pytestmark = pytest.mark.check

SLOW_MS = 60_000
LOOKS = 3
MANY_IN_THE_FIRST_CHART = """async () => {
  const end = Date.now() + 20000;
  const isThere = () => charts.some((each) => each.root.isConnected && each.data[0].length > 1000);
  while (!isThere() && Date.now() < end) await new Promise((go) => setTimeout(go, 50));
  return isThere();
}"""


def test_the_overview_lives_and_leads_to_the_station(site, open_page, screenshots) -> None:
    page = open_page(site.url)
    line = page.get_by_role("row").filter(has_text="alpha")
    expect(line).to_contain_text("m", timeout=SLOW_MS)
    level = line.locator(".gauge .value")
    before = level.inner_text()
    expect(level).not_to_have_text(before, timeout=SLOW_MS)
    page.screenshot(path=screenshots / "overview.png")
    line.get_by_role("link", name="alpha").click()
    expect(page).to_have_url(f"{site.url}/station/alpha")
    expect(page.get_by_role("heading", level=1)).to_have_text("alpha")


def test_live_values_move_and_pumps_turn(site, open_page) -> None:
    page = open_page(f"{site.url}/station/alpha")
    level = page.locator(".well .big")
    expect(level).to_contain_text("m", timeout=SLOW_MS)
    before = level.text_content()
    expect(level).not_to_have_text(before, timeout=SLOW_MS)
    expect(page.locator(".pump.runs").first).to_be_visible(timeout=SLOW_MS)
    name = page.locator(".pump.runs .impeller").first.evaluate("node => getComputedStyle(node).animationName")
    assert name in {"turn", "none"}  # none: the pump has stopped meanwhile


def stands(page, level):
    """What a level shows once it shows the same for 2 s; what was on its way when the plant was held still comes."""
    for _ in range(LOOKS):
        held = level.text_content()
        page.wait_for_timeout(2_000)  # of a plant that stands nothing comes that one could wait for
        if level.text_content() == held:
            return held
    return None


@pytest.mark.long
def test_the_plant_is_held_let_go_and_slowed_down(site, open_page) -> None:
    page = open_page(f"{site.url}/station/alpha")
    clock = page.get_by_role("group", name="Clock of the simulated plant")
    level = page.locator(".well .big")
    expect(clock).to_be_visible(timeout=SLOW_MS)
    clock.get_by_role("button", name="hold").click()
    try:
        expect(clock.get_by_role("button", name="go on")).to_have_attribute("aria-pressed", "true", timeout=SLOW_MS)
        held = stands(page, level)
        assert held is not None
    finally:
        clock.get_by_role("button", name="go on").click()
    expect(clock.get_by_role("button", name="hold")).to_have_attribute("aria-pressed", "false", timeout=SLOW_MS)
    expect(level).not_to_have_text(held, timeout=SLOW_MS)
    speed = clock.get_by_label("Speed of the plant")
    before = site.plant_clock()["speed"]
    try:
        with page.expect_response("**/plant-clock"):  # the page stands while the test asks the site
            speed.select_option("10")
        assert site.plant_clock()["speed"] == 10.0
    finally:
        site.plant_clock(speed=before)


@pytest.mark.long
def test_who_wants_no_motion_gets_none(site, open_page) -> None:
    page = open_page(f"{site.url}/station/alpha", reduced_motion="reduce")
    expect(page.locator(".pump.runs").first).to_be_visible(timeout=SLOW_MS)
    moving = page.locator(".pump .impeller").evaluate_all(
        "nodes => nodes.filter(node => getComputedStyle(node).animationName !== 'none').length"
    )
    assert moving == 0


def test_a_blockage_turns_the_right_pump_red_and_tells_why(site, open_page, screenshots) -> None:
    page = open_page(f"{site.url}/station/alpha?pump=2")
    expect(page.locator('.pump[data-state="pump_fault"] .name')).to_have_text(["Pump 2"], timeout=120_000)
    pump = page.locator('.pump[data-state="pump_fault"]')
    theme = (files("wetwell.services") / "reports" / "theme.css").read_text(encoding="utf-8")
    red = re.search(r"--urgent: light-dark\(#(\w{6})", theme)[1]
    rgb = f"rgb({int(red[:2], 16)}, {int(red[2:4], 16)}, {int(red[4:], 16)})"
    expect(pump.locator("circle")).to_have_css("stroke", rgb)  # once the stage is "act"
    expect(pump.locator(".condition")).to_have_text("pump fault")
    expect(page.locator("#station-state")).to_have_attribute("data-state", "pump_fault")
    expect(page.locator(".curve.now.fault")).to_have_count(1)
    expect(page.locator(".plane .label").first).to_have_text("pump curve, moved")
    cause = page.locator(".is-cause")
    expect(cause.locator(".cause")).to_have_text([re.compile("^pump 2: ")])
    for word in ("Pump 2 is at fault since", "loss of", ", limit ", "pull the pump", "Expected cost; cheapest"):
        expect(cause).to_contain_text(word)
    expect(cause.locator(".severity")).to_be_visible()
    expect(cause.locator(".evidence")).to_be_hidden()
    cause.get_by_text("Statistics").click()
    for word in ("onset", "F-test, pump", "I_W", "pump curve"):
        expect(cause.locator(".evidence")).to_contain_text(word)
    assert page.locator(".well .main.fault").count() == 0
    page.screenshot(path=screenshots / "station.png", full_page=True)
    overview = open_page(f"{site.url}/?state=fault")
    line = overview.get_by_role("row").filter(has_text="alpha")
    expect(line.locator(".state")).to_have_text("pump fault", timeout=SLOW_MS)
    told = re.compile(r"pump 1 \w+, normal; pump 2 \w+, pump fault; pump 3 \w+, normal")
    expect(line.get_by_role("img")).to_have_attribute("aria-label", told)


def test_acknowledging_by_name_works_and_survives_a_reload(site, open_page, screenshots) -> None:
    page = open_page(f"{site.url}/alarms")
    row = page.get_by_role("row").filter(has_text="level high")
    expect(row).to_contain_text("unacknowledged", timeout=SLOW_MS)
    page.screenshot(path=screenshots / "alarms.png")
    row.get_by_role("button", name="acknowledge").click()
    page.get_by_label("Your name").fill("Ada")
    page.get_by_role("dialog").get_by_role("button", name="acknowledge").click()
    expect(row).to_contain_text("acknowledged by Ada", timeout=SLOW_MS)
    assert ("level_high", "acknowledge", "Ada") in [(act["alarm"], act["act"], act["by"]) for act in site.acts]
    page.reload()
    expect(row).to_contain_text("acknowledged by Ada", timeout=SLOW_MS)
    row.get_by_role("button", name="shelve").click()
    expect(page.get_by_label("Your name")).to_have_value("Ada")
    page.keyboard.press("Escape")
    expect(page.get_by_role("dialog")).to_have_count(0)


@pytest.mark.long
def test_the_address_holds_the_view(site, open_page) -> None:
    page = open_page(f"{site.url}/station/alpha")
    page.get_by_role("group", name="Pump").get_by_role("button", name="Pump 3").click()
    page.get_by_role("button", name="24 h").click()
    page.get_by_label("Theme").select_option("dark")
    expect(page).to_have_url(re.compile("pump=3"))
    expect(page).to_have_url(re.compile("span=24h"))
    expect(page).to_have_url(re.compile("theme=dark"))
    page.reload()
    expect(page.get_by_role("button", name="Pump 3")).to_have_attribute("aria-pressed", "true")
    expect(page.get_by_role("button", name="24 h")).to_have_attribute("aria-pressed", "true")
    assert page.evaluate("document.documentElement.dataset.theme") == "dark"
    expect(page.get_by_role("link", name="download as recording")).to_have_attribute(
        "href", re.compile(r"recording\.csv")
    )


def test_the_page_comes_back_when_the_server_does(site, open_page, unused_port) -> None:
    port = unused_port()
    with site.dashboard(port) as server:
        page = open_page(f"http://127.0.0.1:{port}/station/alpha", may_lose_its_server=True)
        expect(page.locator("#link")).to_have_text("live", timeout=SLOW_MS)
        server.send_signal(signal.SIGTERM)
        assert server.wait(10) == 0, "an open event stream must not hold the server up"
        expect(page.locator("#link")).to_have_text("connection lost, trying again", timeout=SLOW_MS)
    with site.dashboard(port):
        expect(page.locator("#link")).to_have_text("live", timeout=SLOW_MS)
        told = page.locator("#station-time")
        before = told.inner_text()
        expect(told).not_to_have_text(before, timeout=SLOW_MS)
        # At most 32 samples a second come live: so many are those that the historian has kept.
        assert page.evaluate(MANY_IN_THE_FIRST_CHART)


@pytest.mark.long
def test_where_tokens_are_asked_for_one_is_given_once(site, open_page, unused_port, tmp_path) -> None:
    file, port = tmp_path / "tokens.toml", unused_port()
    token = new_token(file, "ada", "operator")
    with site.dashboard(port, WETWELL_SECURITY__TOKENS_FILE=str(file)):
        page = open_page(f"http://127.0.0.1:{port}/alarms")
        for given in ("wrong", token):
            page.get_by_label("Token").fill(given)
            page.get_by_role("button", name="enter").click()
            if given == "wrong":
                expect(page.get_by_role("alert")).to_have_text("This token is not known.")
        expect(page.locator("#link")).to_have_text("live", timeout=SLOW_MS)
        page.reload()
        row = page.get_by_role("row").filter(has_text="level high")
        row.get_by_role("button", name="shelve").click()
        expect(page.get_by_label("Your name")).to_have_value("ada")
        expect(page.get_by_label("Your name")).not_to_be_editable()
        page.close()  # before its server goes


@pytest.mark.parametrize(
    ("path", "scheme"),
    [
        ("/", "light"),
        pytest.param("/", "dark", marks=pytest.mark.long),
        pytest.param("/station/alpha", "light", marks=pytest.mark.long),
        pytest.param("/station/alpha", "dark", marks=pytest.mark.long),
        pytest.param("/station/alpha?span=24h", "light", marks=pytest.mark.long),
        ("/station/alpha?from=2025-01-01T04:00:00Z&to=2025-01-01T08:00:00Z&at=2025-01-01T07:30:00Z", "dark"),
        ("/alarms", "dark"),
        *(
            pytest.param(path, "light", marks=pytest.mark.long)
            for path in ("/alarms?show=journal", "/reports", "/health")
        ),
    ],
)
def test_axe_finds_nothing_serious(site, open_page, axe, path, scheme) -> None:
    page = open_page(site.url + path, color_scheme=scheme)
    expect(page.get_by_role("heading", level=1)).to_be_visible()
    expect(page.locator("#link")).to_have_text("live", timeout=SLOW_MS)
    expect(page.locator("svg.well:empty, #plane-words:empty")).to_have_count(0)
    serious = axe(page)
    assert serious == [], json.dumps(serious, indent=1)


@pytest.mark.parametrize(
    ("width", "height"),
    [(390, 844), *(pytest.param(*one, marks=pytest.mark.long) for one in [(1280, 720), (2560, 1440)])],
)
def test_nothing_sticks_out_from_phone_to_wall(site, open_page, screenshots, width, height) -> None:
    page = open_page(f"{site.url}/station/alpha", viewport={"width": width, "height": height}, color_scheme="dark")
    expect(page.locator(".well .big")).to_contain_text("m", timeout=SLOW_MS)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.screenshot(path=screenshots / f"station-{width}.png")


def test_on_a_phone_an_alarm_has_its_buttons_in_sight(site, open_page) -> None:
    page = open_page(f"{site.url}/alarms", viewport={"width": 390, "height": 844})
    row = page.get_by_role("row").filter(has_text="level high")
    expect(row.get_by_role("button", name="shelve")).to_be_in_viewport(ratio=1.0, timeout=SLOW_MS)
