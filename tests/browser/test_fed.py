"""Pages of stations that a test feeds over a bus: a thousand of them, bad values, a watched gap, summer time."""

import asyncio
import re
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest
from browser_site import Site, rows_taken_along, until, wetwell
from playwright.sync_api import expect
from ports import free_port

from wetwell.detector.verdict.station_model import StationModel
from wetwell.protocols.bus.keys import alarm_key, gap_key, model_key, sample_key, verdict_key
from wetwell.protocols.bus.zenoh.link import connect_client
from wetwell.protocols.messages.alarm import Alarm
from wetwell.protocols.messages.gap_watch import GapLook, GapName, GapWatch
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.verdict import AssetFault, Severity, Trend, Verdict
from wetwell.protocols.timestamps import NS_PER_DAY, NS_PER_S, from_iso
from wetwell.services.alarms.rules import RULES, fault_text
from wetwell.services.stations import find_station

pytestmark = pytest.mark.check

STATIONS = 1000
SPRING_NS = from_iso("2026-03-29T01:00:00Z")
"""In Berlin it is 2 o'clock, and 3 o'clock."""
FAULTS = {
    7: (
        "main",
        "act",
        900.0,
        Severity(quantity="friction_rise_percent", value=16.2, interval=(15.4, 17.0), limit=15.0),
    ),
    42: ("pump:2", "act", 1500.0, Severity(quantity="speed_loss_percent", value=4.0, interval=(3.5, 4.5), limit=3.0)),
    500: (
        "main",
        "plan",
        80.0,
        Severity(quantity="friction_rise_percent", value=9.1, interval=(8.4, 9.8), limit=15.0),
    ),
    900: ("pump:1", "watch", 5.0, Severity(quantity="speed_loss_percent", value=0.7, interval=(0.5, 0.9), limit=3.0)),
}
BAD, UNHEARD, CALLS, WATCHED, FLUSHED, TWO_MAINS = 123, 124, 200, 300, 700, 800
TWIN = find_station("twin")
MAINS = [main.name for main in TWIN.mains]
FAULTS[FLUSHED] = FAULTS[7]
"""Of this one pump 1 stands since its main was flushed, which pump 2 tells."""
FIRST = ["s-0042", "s-0007", "s-0800", "s-0123", "s-0124", "s-0500", "s-0200", "s-0900", "s-0000"]
"""Act, the dearer first; nobody sees it; plan; an alarm waits; watch; all is well."""
IN_ORDER = """nodes => nodes.sort((a, b) => a.ariaRowIndex - b.ariaRowIndex)
  .map(node => node.querySelector("a").textContent)"""
DRAWN_OF_GAP = """charts.filter(each => each.root.isConnected && each.root.closest(".is-gap"))
  .map(each => [each.data.length, each.data[1].filter(Number.isFinite).length])"""
ENGLISH = r"\b(the|of|is|are|no|not|and|with|from|since|pump|pages|flow|head|runs|days|what|gap|stations|alarms)\b"
SERVICES_SAY = "the historian does not answer"
"""What a service says in words of its own stays English."""


def sample(number, time_ns):
    pump = PumpReading(frequency_hz=50.0, flow_m3h=200.0, head_m=26.0, power_kw=18.0, running=True)
    rest = PumpReading(frequency_hz=0.0, flow_m3h=0.0, head_m=None, power_kw=0.4, running=False)
    quality = "bad" if number == BAD else "good"
    return Sample(
        station=f"s-{number:04}",
        seq=time_ns // NS_PER_S,
        time=time_ns,
        level_m=1.0,
        pumps=(pump, rest),
        quality=quality,
    )


def verdict(number):
    asset, stage, cost, severity = FAULTS.get(number, (None, None, None, None))
    trend = Trend(per_day=0.8, interval=(0.6, 1.0), reaches_limit=SPRING_NS + 9 * NS_PER_DAY)
    fault = asset and AssetFault(
        asset=asset, stage=stage, since=SPRING_NS - 5 * NS_PER_DAY, severity=severity, trend=trend
    )
    state = "normal" if asset is None else "system_fault" if asset == "main" else "pump_fault"
    expected = {} if cost is None else {"cost": {"cheapest": "pull the pump", "expected": {"wait": cost}}}
    return Verdict(
        time=SPRING_NS, station=f"s-{number:04}", pump=1, state=state, probability={state: 1.0}, evidence=expected,
        window=(SPRING_NS, SPRING_NS), faults=(fault,) if fault else (),
    )  # fmt: skip


def alarms():
    """Alarms as the service tells them: with figures in its text, without, and of a fault."""
    fault = verdict(7).faults[0]
    told = [
        ("level_high", {"text": "level high: 2.31 m, limit 2.00 m"}),
        ("detector_silent", {"text": RULES["detector_silent"].text, "advice": RULES["detector_silent"].advice}),
        ("samples_stale", {"text": "no samples for 90 s"}),
        ("main.system_fault", {"text": fault_text(fault), "asset": "main", "stage": "act", "trend": fault.trend,
                               "severity": fault.severity}),
    ]  # fmt: skip
    return [
        Alarm(id=name, time=SPRING_NS, station=f"s-{CALLS:04}", priority="high", state="unacknowledged",
              is_active=True, raised=SPRING_NS, **words) for name, words in told
    ]  # fmt: skip


def watched_gap():
    factor = {"factor": {"value": 1.1, "ci": [1.09, 1.11], "unit": "1"}}
    effect = {"name": "friction_bias", "component": "rising_main", "equivalent": [], "parameters": factor}
    since = SPRING_NS - 3 * NS_PER_DAY
    called = GapName(effect=effect, component="rising_main", probability=0.98, since=since, fault="main", text="x")
    past = GapName(component="flow_meter", probability=0.9, ended=since, text="x")
    looks = [
        GapLook(time=SPRING_NS - day * NS_PER_DAY, gap={"flow": 2.5 - day / 40, "head": 1.2}, matters=1.9 - day / 40,
                interval=(1.5, 2.1)) for day in range(30, -1, -1)
    ]  # fmt: skip
    return GapWatch(
        time=SPRING_NS, station=f"s-{WATCHED:04}", gap=looks[-1].gap, matters=1.9, interval=(1.8, 2.0),
        group="flow/1/steady", first_matters=0.7, is_doubled=True, called=(called,), past=(past,), looks=tuple(looks),
    )  # fmt: skip


def connected(endpoint):
    """A bus; made in a thread of its own, as the browser's loop runs in this one."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, connect_client(endpoint)).result()


@pytest.fixture(scope="module")
def fed(tmp_path_factory):
    """Router and page, and a thousand stations that this process tells of; a sample counts as new for an hour."""
    place = Site(f"tcp/127.0.0.1:{free_port()}", free_port(), tmp_path_factory.mktemp("fed"))
    with (
        wetwell("router", "--zenoh", place.endpoint),
        place.dashboard(place.port, WETWELL_DASHBOARD__STALE_S="3600"),
        connected(place.endpoint) as bus,
    ):
        heard = [number for number in range(STATIONS) if number != UNHEARD]
        samples = {number: bus.publisher(sample_key(f"s-{number:04}")) for number in heard}

        def all_are_known():
            for second in (-30, -20):
                for number, publisher in samples.items():
                    publisher.put(sample(number, SPRING_NS + second * NS_PER_S).encode())
            return len(httpx.get(f"{place.url}/api/stations", timeout=10).json()["live"]) >= len(heard)

        until(all_are_known)
        for number in range(STATIONS):
            bus.publisher(verdict_key(f"s-{number:04}", 1)).put(verdict(number).encode())
        told = {"time": SPRING_NS + NS_PER_S, "pump": 2, "state": "normal", "faults": ()}
        flushed = verdict(FLUSHED).model_copy(update=told)
        bus.publisher(verdict_key(flushed.station, 2)).put(flushed.encode())
        model = StationModel(TWIN).message((None,) * 4, {}, 0).model_copy(update={"station": f"s-{TWO_MAINS:04}"})
        bus.publisher(model_key(model.station)).put(model.encode())
        fault = verdict(7).faults[0].model_copy(update={"asset": f"main:{MAINS[0]}"})
        told = {"evidence": {"main": MAINS[0]}, "state": "system_fault", "faults": (fault,)}
        bus.publisher(verdict_key(model.station, 1)).put(verdict(TWO_MAINS).model_copy(update=told).encode())
        for alarm in alarms():
            bus.publisher(alarm_key(alarm.station, alarm.id)).put(alarm.encode())
        bus.publisher(gap_key(f"s-{WATCHED:04}")).put(watched_gap().encode())

        def all_is_told():
            shown = httpx.get(f"{place.url}/api/stations", timeout=10).json()["stations"].values()
            told = {station["name"]: station for station in shown}
            is_judged = len(told) == STATIONS and all(station["state"] != "unknown" for station in shown)
            return is_judged and told[f"s-{CALLS:04}"]["alarms"] == len(alarms()) and told[f"s-{WATCHED:04}"]["gap"]

        until(all_is_told)
        place.tell = lambda number, time_ns: samples[number].put(sample(number, time_ns).encode())
        yield place


def test_a_thousand_stations_stand_in_the_order_of_need_and_only_those_in_sight_are_made(fed, open_page, axe) -> None:
    page = open_page(fed.url)
    table = page.get_by_role("table", name="Stations")
    expect(table).to_have_attribute("aria-rowcount", str(STATIONS + 1))
    expect(page.get_by_role("row").nth(1)).to_contain_text(FIRST[0])
    assert page.locator(".stations .sheet .line").evaluate_all(IN_ORDER)[: len(FIRST)] == FIRST
    assert page.locator(".stations .sheet .line").count() < 60
    line = page.get_by_role("row").filter(has_text="s-0007")
    for told in ("rising main", "act", "2026-03-24", "16.2 / 15.0 %", "↗ 0.80 %/day", "900"):
        expect(line).to_contain_text(told)
    assert axe(page) == []
    expect(line.get_by_role("img")).to_have_attribute("aria-label", "pump 1 runs, see main; pump 2 stands, unknown")
    assert line.locator(".pumps [class*=urgent]").count() == 0, "the main is at fault, and not the pumps"
    table.locator(".window").evaluate("node => node.scrollTo(0, node.scrollHeight)")
    expect(page.get_by_role("link", name="s-0999")).to_be_visible()
    page.get_by_label("Find a station").fill("s-05")
    expect(table).to_have_attribute("aria-rowcount", "101")
    page.get_by_label("Find a station").fill("")
    rows = rows_taken_along(page, page, fed.folder)
    assert [row["name"] for row in rows[: len(FIRST)]] == FIRST
    assert len(rows) == STATIONS
    assert (rows[0]["at_fault"], rows[0]["stage"], rows[0]["cost_of_waiting"]) == ("pump 2", "act", "1500")


def test_a_thousand_stations_fit_a_phone(fed, open_page) -> None:
    page = open_page(fed.url, viewport={"width": 390, "height": 844})
    card = page.get_by_role("row").filter(has_text="s-0042")
    for told in ("pump 2", "act"):
        expect(card.get_by_text(told, exact=True)).to_be_in_viewport(ratio=1.0)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    lines = page.locator(".stations .sheet .line")
    assert lines.count() < 60
    page.evaluate("scrollTo(0, document.documentElement.scrollHeight)")
    expect(page.get_by_role("link", name="s-0999")).to_be_in_viewport()
    assert lines.count() < 60


@pytest.mark.long
def test_what_a_source_calls_bad_and_what_was_never_seen_is_not_in_ink(fed, open_page) -> None:
    page = open_page(f"{fed.url}/station/s-{BAD:04}")
    expect(page.locator(".well .water")).to_have_attribute("data-quality", "bad")
    expect(page.locator("#station-time")).to_contain_text("bad: its source says bad")
    expect(page.locator(".trends")).to_have_attribute("data-quality", "bad")
    overview = open_page(fed.url)
    unheard = overview.get_by_role("row").filter(has_text=f"s-{UNHEARD:04}")
    expect(unheard.locator(".gauge .value")).to_have_attribute("data-quality", "never")
    expect(unheard).to_contain_text("no data")
    expect(unheard).not_to_contain_text("normal")


@pytest.mark.long
def test_a_main_that_was_flushed_is_told_by_the_newest_verdict_whatever_pump_ran_before(fed, open_page) -> None:
    page = open_page(f"{fed.url}/station/s-{FLUSHED:04}?pump=1")
    expect(page.locator(".sentence")).to_have_text("Pump 1 and its main are as they were learnt.")
    expect(page.locator("#station-state")).to_have_text("normal")
    expect(page.locator(".pump .condition")).to_have_text(["normal", "normal"])
    expect(page.locator(".well .main.fault")).to_have_count(0)
    expect(page.locator(".cause")).to_have_count(0)


@pytest.mark.long
def test_of_two_mains_the_one_that_is_at_fault_says_so(fed, open_page) -> None:
    page = open_page(f"{fed.url}/station/s-{TWO_MAINS:04}")
    expect(page.locator(".well .main.fault title")).to_have_text([f"{MAINS[0]}, system fault: act"])
    told = page.locator(".well text").filter(has_text="system fault")
    expect(told).to_have_text(re.compile(rf"^{MAINS[0]} .* m³/h, system fault: act; {MAINS[1]} .{{1,6}} m³/h$"))


def test_one_cursor_goes_through_all_trends(fed, open_page) -> None:
    page = open_page(f"{fed.url}/station/s-0042")
    trends = page.locator(".is-trends .u-over")
    expect(trends).to_have_count(6)

    def one_cursor_shows():
        trends.nth(2).hover()  # scrolls, and again where a chart was made anew meanwhile
        places = page.locator(".is-trends .u-cursor-x").evaluate_all(
            "nodes => nodes.map(node => node.style.transform)"
        )
        return len(places) == 6 and len(set(places)) == 1 and places[0] not in {"", "translate(-10px, 0px)"}

    until(one_cursor_shows)
    expect(page.locator(".is-trends .readout")).to_contain_text("level 1.00 m")


@pytest.mark.long
def test_the_watched_gap_is_a_sentence_two_pictures_and_names(fed, open_page, axe, screenshots) -> None:
    page = open_page(f"{fed.url}/station/s-{WATCHED:04}")
    panel = page.locator(".is-gap")
    expect(panel.locator(".lead")).to_contain_text("1.90 times what matters from its simulator")
    expect(panel.locator(".lead")).to_contain_text("Flow of pump 1, while it runs steadily")
    expect(panel.locator(".lead")).to_contain_text("It has doubled.")
    expect(panel.locator(".names li")).to_have_text([
        re.compile(r"rising main: friction bias, 1\.10 \(1\.09 – 1\.11\), since 2026-03-26 .*tells it as a fault"),
        re.compile(r"flow meter: something that no effect explains, from the first look on, over since 2026-03-26"),
    ])  # fmt: skip
    assert page.evaluate(DRAWN_OF_GAP) == [[2, 31], [3, 31]]
    expect(
        panel.locator('.absent[data-service="watch"]')
    ).to_be_visible()  # what it said last stands, and that it is away
    assert axe(page) == []
    panel.screenshot(path=screenshots / "gap.png")
    line = open_page(fed.url, viewport={"width": 2200, "height": 1000})
    line.get_by_label("Find a station").fill(f"s-{WATCHED:04}")
    expect(line.get_by_role("row").filter(has_text=f"s-{WATCHED:04}")).to_contain_text("1.9, doubled")


@pytest.mark.parametrize(
    "path",
    [
        "/",
        f"/station/s-{WATCHED:04}",
        *(pytest.param(path, marks=pytest.mark.long) for path in ("/station/s-0042", "/alarms", "/health")),
        pytest.param("/station/nowhere", marks=pytest.mark.long),
    ],
)
def test_no_english_is_left_on_a_german_page(fed, open_page, path) -> None:
    page = open_page(fed.url + path, locale="de-DE", timezone_id="Europe/Berlin", may_lose_its_server=True)
    expect(page.get_by_role("heading", level=1).first).to_be_visible()
    expect(page.locator("#link")).to_have_text("live")
    page.locator("details").evaluate_all("nodes => nodes.forEach(node => (node.open = true))")
    shown = page.locator("body").inner_text() + " ".join(
        page.locator("[aria-label], [title], [placeholder]").evaluate_all(
            "nodes => nodes.flatMap(node => [node.ariaLabel, node.title, node.placeholder]).filter(Boolean)"
        )
    )
    own = shown.replace(SERVICES_SAY, "")
    english = {found.group(0).lower() for found in re.finditer(ENGLISH, own, re.IGNORECASE)}
    assert english == set(), f"{sorted(english)} in {shown}"


def test_an_alarm_is_told_in_the_language_of_the_reader_with_what_is_known_of_its_fault(fed, open_page) -> None:
    page = open_page(f"{fed.url}/alarms?lang=de")
    expect(page.locator("tr.alarm .text .strong")).to_have_count(4)
    *plain, of_fault = sorted(page.locator("tr.alarm .text .strong").all_inner_texts(), key=len)
    assert plain == ["Detektor läuft nicht", "keine Messwerte seit 90 s", "Pegel hoch: 2,31 m, Grenze 2,00 m"]
    size = "mehr Reibung 16,2 % (+15,4 bis +17,0), Grenze 15,0 %, wächst um 0,80 % am Tag"
    assert of_fault == f"Leitungsfehler – Druckleitung: handeln, {size}, die Grenze wird am 2026-04-07 erreicht"


@pytest.mark.long
def test_local_time_goes_on_over_the_change_to_summer_time(fed, open_page) -> None:
    berlin = {"timezone_id": "Europe/Berlin", "locale": "de-DE"}
    page = open_page(f"{fed.url}/station/s-0600", may_lose_its_server=True, **berlin)  # it has no historian
    told = page.locator("#station-time")
    expect(told).to_have_text("2026-03-29 01:59:40 MEZ")
    fed.tell(600, SPRING_NS + 20 * NS_PER_S)
    expect(told).to_have_text("2026-03-29 03:00:20 MESZ")
    page.get_by_label("von", exact=True).fill("2026-03-29T01:30:00")
    page.get_by_label("bis", exact=True).fill("2026-03-29T03:30:00")
    page.get_by_role("button", name="zeigen", exact=True).click()
    expect(page).to_have_url(
        re.compile(re.escape("from=2026-03-29T00%3A30%3A00.000Z&to=2026-03-29T01%3A30%3A00.000Z"))
    )
    page.get_by_label("von", exact=True).fill("2026-10-25T01:00:00")
    page.get_by_label("bis", exact=True).fill("2026-10-25T04:00:00")
    page.get_by_role("button", name="zeigen", exact=True).click()
    expect(page).to_have_url(
        re.compile(re.escape("from=2026-10-24T23%3A00%3A00.000Z&to=2026-10-25T03%3A00%3A00.000Z"))
    )


@pytest.mark.parametrize("width", [1280, *(pytest.param(width, marks=pytest.mark.long) for width in (1600, 1920))])
@pytest.mark.parametrize("lang", ["en", "de"])
def test_nothing_of_a_fault_is_cut_off_in_the_overview(fed, open_page, width, lang) -> None:
    page = open_page(f"{fed.url}/?lang={lang}", viewport={"width": width, "height": 900})
    expect(page.get_by_role("row").filter(has_text="s-0007")).to_be_visible()
    cut = page.locator(".stations .sheet .cell").evaluate_all(
        "nodes => nodes.filter(node => node.checkVisibility() && node.scrollWidth > node.clientWidth)"
        ".map(node => node.textContent)"
    )
    assert cut == [], cut
