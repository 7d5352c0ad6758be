"""What keeps the rooms of the house: few modules in each, one meaning a constant, one place for array types."""

import ast
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("protocols", "simulator", "detector", "sim2real", "services")
MOST_MODULES = 14
"""What a reader takes in at a glance; a folder with more is parted by stage or component."""
ARRAY_TYPES = Path("protocols", "arrays.py")

every_package = pytest.mark.parametrize("package", PACKAGES)


def modules(package):
    return sorted((ROOT / package).rglob("*.py"))


def constants(path):
    """(name, value) of the constants of a module; the value as it is written where it is no literal."""
    for node in ast.parse(path.read_text()).body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        value = getattr(node, "value", None)
        if not isinstance(node, ast.Assign | ast.AnnAssign) or value is None:
            continue
        parts = [(targets[0], value)]
        if isinstance(targets[0], ast.Tuple) and isinstance(value, ast.Tuple):
            parts = list(zip(targets[0].elts, value.elts, strict=True))
        for target, each in parts:
            if isinstance(target, ast.Name) and target.id.isupper():
                yield target.id, value_of(each)


def value_of(node):
    try:
        literal = ast.literal_eval(node)
    except ValueError:
        return ast.unparse(node)
    return literal if isinstance(literal, int | float) else repr(literal)


@every_package
def test_no_folder_has_more_modules_than_a_reader_takes_in(package):
    counts = defaultdict(int)
    for path in modules(package):
        counts[path.parent.relative_to(ROOT).as_posix()] += path.name != "__init__.py"
    assert {folder: count for folder, count in counts.items() if count > MOST_MODULES} == {}


@every_package
def test_no_constant_has_two_values_in_a_package(package):
    values = defaultdict(lambda: defaultdict(list))
    for path in modules(package):
        for name, value in constants(path):
            values[name][value].append(path.relative_to(ROOT).as_posix())
    assert {name: dict(found) for name, found in values.items() if len(found) > 1} == {}


@every_package
def test_types_of_arrays_are_named_in_one_file(package):
    named = [
        f"{path.relative_to(ROOT)}: {ast.unparse(node)}"
        for path in modules(package)
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.Assign | ast.AnnAssign)
        and node.value is not None
        and ast.unparse(node.value).startswith(("npt.NDArray[", "NDArray["))
        and path.relative_to(ROOT) != ARRAY_TYPES
    ]
    assert named == []


@every_package
def test_a_package_has_rooms_and_few_modules_beside_them(package):
    """A stage or a component is a folder; only what has no better room lies beside them."""
    beside = {path.name for path in (ROOT / package).glob("*.py")} - {"__init__.py", "__main__.py"}
    assert len(beside) <= MOST_MODULES
    assert [path.name for path in (ROOT / package).iterdir() if (path / "__init__.py").is_file()]


def test_every_room_of_modules_is_a_package():
    folders = {path.parent for package in PACKAGES for path in modules(package)}
    assert [folder.relative_to(ROOT).as_posix() for folder in folders if not (folder / "__init__.py").is_file()] == []
