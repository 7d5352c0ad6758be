"""Files that a page names in the repository are there, and define what the page says that they define."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "benchmarks" / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
]
"""Decisions and the change log tell of their day."""
FOLDERS = {path.name for path in ROOT.iterdir() if path.is_dir() and not path.name.startswith(".")} - {"build"}
MADE = ("docker/secrets/", "docker/site/", "docker/site.env")
"""What `docker/secrets.sh` writes."""
NAMED = re.compile(r"`([\w.-]+(?:/[\w.-]*)+)(?::{1,2} ?(\w+)[\w.]*)?`")
"""A path in code type, and what it defines: `folder/file.py: name`."""


def named(page):
    """(path, name or empty) of what lies in a folder of the repository."""
    return [
        (path, name)
        for path, name in NAMED.findall(page.read_text(encoding="utf-8"))
        if path.partition("/")[0] in FOLDERS and not path.startswith(MADE)
    ]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_files_that_a_page_names_are_there(page):
    assert [path for path, _ in named(page) if not (ROOT / path).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_files_define_what_a_page_says(page):
    missing = []
    for path, name in named(page):
        if name and path.endswith(".py") and (ROOT / path).exists():
            tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
            words = {getattr(node, "name", getattr(node, "id", None)) for node in ast.walk(tree)}
            missing += [f"{path}: {name}"] if name not in words else []
    assert missing == []


def test_pages_name_files():
    assert sum(len(named(page)) for page in PAGES) > 40


def test_the_architecture_page_has_all_rooms_and_no_other():
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    table = page.partition("## Rooms\n")[2].partition("\n## ")[0]
    rooms, package = set(), ""
    for cell in re.findall(r"^\| (.*?) \|", table, re.MULTILINE):
        folders = re.findall(r"`(\w+)/`", cell)
        if cell.startswith("**"):
            (package,) = folders
        else:
            rooms |= {f"{package}/{folder}" for folder in folders}
    packages = {room.partition("/")[0] for room in rooms}
    assert rooms == {
        path.parent.relative_to(ROOT).as_posix() for name in packages for path in (ROOT / name).glob("*/__init__.py")
    }
