"""A site in processes of its own, and a browser that looks at it."""

from pathlib import Path

import pytest
from browser_site import CLOGGING, SCENARIO, until, whole_site
from playwright.sync_api import expect, sync_playwright
from ports import free_port

CHROMIUM = Path("/usr/bin/chromium")
AXE = Path(__file__).parent / "vendor" / "axe.min.js"
SCREENSHOTS = Path(__file__).parents[2] / "build" / "screenshots"
CALM_SPEED = 120.0
"""Of the plant, once what the tests look at has happened: its pumps start every few seconds."""
expect.set_options(timeout=60_000)
SEE_CHARTS = """
let original = null;
window.charts = [];
Object.defineProperty(window, "uPlot", {
  get: () => original,
  set(made) {
    const construct = (kind, given) => window.charts[window.charts.push(new kind(...given)) - 1];
    original = new Proxy(made, { construct });
  },
});
"""
"""Puts all charts of a page into `charts`, in the order in which they were made."""


def pytest_collection_modifyitems(items):
    """Skip the tests of this folder where there is no browser; `items` are those of all folders."""
    if not CHROMIUM.exists():
        for item in items:
            if item.path.is_relative_to(Path(__file__).parent):
                item.add_marker(pytest.mark.skip(reason=f"{CHROMIUM} is not installed (Debian package chromium)"))


@pytest.fixture(scope="session")
def site(tmp_path_factory):
    """A site whose pump 2 is told as blocked, to be acted on; then its time goes slowly, which costs little."""
    with whole_site(tmp_path_factory.mktemp("site"), SCENARIO) as place:
        until(lambda: place.stage_of("pump:2") == "act")
        assert place.plant_clock(speed=CALM_SPEED)["speed"] == CALM_SPEED
        yield place


@pytest.fixture
def clogged_site(tmp_path):
    """A site of its own for one test, which may kill its parts: its main clogs after seven hours of its time."""
    with whole_site(tmp_path, CLOGGING, stale_s=4.0) as place:
        yield place


@pytest.fixture(scope="session")
def browser():
    flags = ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"]
    with sync_playwright() as tools:
        chromium = tools.chromium.launch(executable_path=str(CHROMIUM), args=flags)
        yield chromium
        chromium.close()


@pytest.fixture
def open_page(browser):
    """Opens addresses in a browser that may reach this machine only; at the end no page may have complained."""
    complaints, foreign, contexts = [], [], []

    def guard(route):
        if route.request.url.split("/")[2].split(":")[0] == "127.0.0.1":
            route.continue_()
        else:
            foreign.append(route.request.url)
            route.abort()

    def open_(url, *, may_lose_its_server=False, **options):
        context = browser.new_context(**{"viewport": {"width": 1600, "height": 1000}} | options)
        contexts.append(context)
        context.route("**/*", guard)
        context.add_init_script(SEE_CHARTS)
        page = context.new_page()
        if not may_lose_its_server:
            page.on(
                "console", lambda told: complaints.append(told.text) if told.type in {"error", "warning"} else None
            )
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(url)
        return page

    yield open_
    for context in contexts:
        context.close()
    assert complaints == []
    assert foreign == []


@pytest.fixture(scope="session")
def axe():
    """Looks at a page with axe; what it finds serious or critical."""

    def looked(page):
        found = page.evaluate(AXE.read_text() + "; axe.run()")
        return [
            (violation["id"], [node["html"][:200] for node in violation["nodes"]][:3])
            for violation in found["violations"]
            if violation["impact"] in {"serious", "critical"}
        ]

    return looked


@pytest.fixture(scope="session")
def unused_port():
    return free_port


@pytest.fixture(scope="session")
def screenshots():
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    return SCREENSHOTS
