"""A missing tool skips the tests that need it, and no others."""

import importlib.util
from pathlib import Path
from types import SimpleNamespace

TESTS = Path(__file__).parents[1]


def test_without_a_browser_only_its_own_tests_are_skipped(tmp_path):
    spec = importlib.util.spec_from_file_location("browser_conftest", TESTS / "browser" / "conftest.py")
    conftest = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(conftest)
    conftest.CHROMIUM = tmp_path / "chromium"
    marked = []
    items = [
        SimpleNamespace(path=path, add_marker=lambda _, path=path: marked.append(path))
        for path in (TESTS / "browser" / "test_page.py", TESTS / "checks" / "test_skips.py")
    ]
    conftest.pytest_collection_modifyitems(items)
    assert marked == [TESTS / "browser" / "test_page.py"]


def test_what_waits_for_make_check_says_so_in_its_own_file():
    """`make others` collects only files that do: from elsewhere nobody would run it."""
    elsewhere = [path for path in TESTS.rglob("*.py") if not path.name.startswith("test_")]
    assert [path.name for path in elsewhere if "mark." + "check" in path.read_text(encoding="utf-8")] == []
