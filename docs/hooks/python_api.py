"""The reference page of `import wetwell`: signatures and docstrings of its names and of their results."""

import inspect
import re
from collections.abc import Iterator
from functools import cached_property
from importlib import import_module
from typing import Any

import wetwell

RESULTS = (
    "frame.Frame",
    "detection.Detection",
    "calibration.Calibration",
    "diagnosis.Diagnosis",
    "backtest.Backtest",
    "result.Picture",
)
"""Classes of what the functions give, in `wetwell.services.api`."""
INTRO = """# Python

`import wetwell` gives these names. Each is loaded when it is asked for, so that the import itself is quick.
A recording is a path, or a table of pandas, polars, DuckDB or Arrow with the
[columns of a recording](recording-keys.md).
A station is a station file, the name of one that comes with the package, or a `wetwell.Station`.
"""


def python_page() -> str:
    """Markdown of the page."""
    return "\n".join([INTRO, *_functions(), "## Results\n", *_results()])


def _functions() -> Iterator[str]:
    for name in wetwell.__all__:
        thing = getattr(wetwell, name)
        if inspect.isfunction(thing):
            yield f"## `wetwell.{name}`\n"
            yield from _entry(name, thing)


def _results() -> Iterator[str]:
    for place in RESULTS:
        module, _, name = place.partition(".")
        thing = getattr(import_module(f"wetwell.services.api.{module}"), name)
        yield f"### `{name}`\n"
        yield _markdown(inspect.getdoc(thing) or "")
        for key, member in inspect.getmembers(thing):
            is_own = inspect.isfunction(member) or isinstance(member, property | cached_property)
            if key.startswith("_") or not is_own:
                continue
            words = (inspect.getdoc(member) or "").partition("\n\n")[0].replace("\n", " ")
            call = "" if isinstance(member, property | cached_property) else "()"
            yield f"- `.{key}{call}`: {words}"
        yield ""


def _entry(name: str, function: Any) -> Iterator[str]:
    known = r"(?:wetwell|collections|pathlib|typing)\.(?:\w+\.)*(\w+)"
    signature = re.sub(known, r"\1", str(inspect.signature(function)))
    signature = signature.replace("str | os.PathLike[str] | ArrowTable", "RecordingSource")
    signature = signature.replace("str | os.PathLike[str] | Station", "StationSource")
    yield f"```python\n{name}{signature}\n```\n"
    yield _markdown(inspect.getdoc(function) or "")


def _markdown(text: str) -> str:
    """Docstring in numpy style as Markdown: sections in bold, their entries as a list, examples as code."""
    head, *sections = re.split(r"^(\w+)\n-{3,}\n", text, flags=re.MULTILINE)
    parts = [head.strip(), ""]
    for title, body in zip(sections[::2], sections[1::2], strict=True):
        parts += [f"**{title}**", ""]
        if title == "Examples":
            parts += [f"```python\n{body.strip()}\n```", ""]
            continue
        for line in body.strip().splitlines():
            if line.startswith(" "):
                parts[-1] += f" {line.strip()}"
            elif line:
                entry, _, kind = line.partition(" : ")
                parts.append(f"- `{entry}`{f' ({kind})' if kind else ''}:")
        parts.append("")
    return "\n".join(parts)
