"""The glossary is true: its names are in the code, all units in use are explained, and no public name is left out."""

import ast
import importlib
import inspect
import pkgutil
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("protocols", "simulator", "detector", "sim2real", "services")
LIBRARIES = PACKAGES[:-1]
GLOSSARY = (ROOT / "docs" / "nomenclature.md").read_text(encoding="utf-8")
UNITS, _, TERMS = GLOSSARY.partition("## Station\n")
PARTS_OF_UNITS = frozenset(
    "m m2 m3 m3h m3s m5 mm s s2 h h2 ns us ms min days hz kw kwh w v a n kg kpa pa rpm l per bytes kb mb".split()  # noqa: SIM905 - read as a line
)
"""What the suffixes of units are made of; a name of which the last parts are such carries a unit."""


@pytest.fixture(scope="module")
def trees():
    return [ast.parse(path.read_text()) for package in PACKAGES for path in (ROOT / package).rglob("*.py")]


def names_in(tree):
    """Classes, functions, parameters, constants, fields and the words that a field may have."""
    for node in ast.walk(tree):
        match node:
            case ast.ClassDef(name=name) | ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name):
                yield name
            case ast.arg(arg=name) | ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                yield name
            case ast.Subscript(value=ast.Name(id="Literal"), slice=words):
                yield from (word.value for word in ast.walk(words) if isinstance(word, ast.Constant))


def glossary_names():
    """Names in the column of names of the glossary's tables."""
    rows = [line.split("|") for line in TERMS.splitlines() if line.startswith("| ")]
    return [name for row in rows for name in re.findall(r"`(\w+)`", row[4])]


def test_every_name_of_the_glossary_is_in_the_code(trees):
    in_code = {name for tree in trees for name in names_in(tree)}
    assert [name for name in glossary_names() if name not in in_code] == []


def test_the_glossary_lists_names():
    assert len(glossary_names()) > 200


def test_every_unit_in_use_is_explained(trees):
    explained = set(re.findall(r"`_(\w+)`", UNITS))
    used = {unit_of(name) for tree in trees for name in names_in(tree) if isinstance(name, str)} - {""}
    assert used - explained == set()
    assert explained - used == set()


def unit_of(name):
    """Suffix of a name that says its unit; empty where it has none, or is nothing else."""
    parts = name.lower().strip("_").split("_")
    first = len(parts)
    while first > 1 and parts[first - 1] in PARTS_OF_UNITS:
        first -= 1
    return "_".join(parts[first:])


def test_every_public_name_is_on_the_page_that_is_made_from_the_code():
    sys.path.insert(0, str(ROOT / "docs" / "hooks"))
    page = importlib.import_module("names").names_page()
    listed = set(re.findall(r"^\| `(\w+)` \| `(\w+).py` \| \S", page, re.MULTILINE))
    public = {
        (name, module.__name__.rpartition(".")[2] if not hasattr(module, "__path__") else "__init__")
        for package in LIBRARIES
        for module in modules(importlib.import_module(f"wetwell.{package}"))
        for name, found in vars(module).items()
        if not name.startswith("_") and is_defined(found, module)
    }
    assert public - listed == set()


def modules(package):
    yield package
    for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        yield importlib.import_module(found.name)


def is_defined(found, module):
    """Whether a class or function, compiled or not, is defined in a module."""
    found = getattr(found, "py_func", found)
    return (inspect.isclass(found) or inspect.isfunction(found)) and found.__module__ == module.__name__
