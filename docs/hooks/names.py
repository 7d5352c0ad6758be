"""The page of all public names: classes and functions, room by room, with the first sentence of their docstrings."""

import ast
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("protocols", "simulator", "detector", "sim2real", "services")
INTRO = """# Names in the code

All public classes and functions, by room; made from the code.
Words, symbols and units: [nomenclature](../nomenclature.md).
"""


def names_page() -> str:
    """Markdown of the page."""
    text = [INTRO]
    for room, rows in groupby(public_names(), key=lambda row: row[0].parent):
        text += [f"## `{room.as_posix()}/`", "", "| name | module | what it is |", "|---|---|---|"]
        text += [f"| `{name}` | `{path.name}` | {_cell(summary)} |" for path, name, summary in rows]
        text += [""]
    return "\n".join(text)


def public_names() -> Iterator[tuple[Path, str, str]]:
    """Module, name and first line of the docstring of each public class and function."""
    for path in modules():
        body = ast.parse((ROOT / path).read_text(encoding="utf-8")).body
        for node, below in zip(body, [*body[1:], None], strict=True):
            if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                name, words = node.name, ast.get_docstring(node) or ""
            elif isinstance(node, ast.Assign) and ast.unparse(node.value).startswith("compiled("):
                name, words = ast.unparse(node.targets[0]), _text(below)
            else:
                continue
            if not name.startswith("_"):
                yield path, name, words.partition("\n")[0]


def _text(node: ast.stmt | None) -> str:
    """The string that stands alone below an assignment."""
    is_text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    return str(node.value.value) if is_text else ""


def modules() -> Iterator[Path]:
    """Modules of all packages, room by room."""
    for package in PACKAGES:
        paths = (path.relative_to(ROOT) for path in (ROOT / package).rglob("*.py"))
        yield from sorted(paths, key=lambda path: (path.parent.parts, path.name))


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("$", "\\$")
