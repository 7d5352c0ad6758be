"""The documentation site: builds without a network, with every page reachable, every link leading somewhere."""

import html
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]
SAID = {
    "detection": (
        "<td>pump:2</td><td>pump_fault</td>",
        "<td>main</td><td>system_fault</td>",
        "<svg",
        "'state': 'learning'",
    ),
    "data_sets": ("truth_fault", "'blockage', ", "(51840, 'alpha')"),
    "gap": ("flow_meter_gain: gap ", "{'factor': 1.1", "<svg", "'none'"),
    "own_method": ("<td>wetwell</td>", "<td>three sigma</td>", "<svg"),
}
"""What the outputs of each notebook, run when the site is built, hold: the claims of its texts."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return folder


def test_every_page_of_docs_is_on_the_site(site):
    pages = {path.relative_to(ROOT / "docs").with_suffix(".html") for path in (ROOT / "docs").rglob("*.md")}
    assert pages <= {path.relative_to(site) for path in site.rglob("*.html")}


def test_the_reference_knows_every_command_and_setting(site):
    commands = (site / "reference" / "commands.html").read_text(encoding="utf-8")
    settings = (site / "reference" / "settings-keys.html").read_text(encoding="utf-8")
    assert all(
        f"wetwell {name}" in commands for name in ("up", "detector rebaseline", "gap diagnose", "station check")
    )
    assert all(name in settings for name in ("state_dir", "endpoint", "word_order", "pull_pump"))


def test_nothing_is_loaded_from_elsewhere(site):
    loaded = [
        url
        for path in site.rglob("*.html")
        for url in re.findall(r"<(?:script|img|iframe|link)[^>]+(?:src|href)=\"?(https?:[^\" >]+)", path.read_text())
    ]
    assert loaded == []


def test_a_notebook_says_what_its_texts_say(site):
    notebooks = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
    assert [notebook.stem for notebook in notebooks] == sorted(SAID)
    for name, said in SAID.items():
        page = (site / "notebooks" / f"{name.replace('_', '-')}.html").read_text(encoding="utf-8")
        shown = page[page.index('<div class="highlight">') : page.index("</article>")]
        text = html.unescape(re.sub(r"<[^>]+>", "", shown))
        assert [words for words in said if words not in shown and words not in text] == [], name
