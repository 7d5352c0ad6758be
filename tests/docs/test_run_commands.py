"""Commands and Python of README and docs, really run in the order of the page, in its own folder; what they print."""

import math
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from ports import free_port
from walks import LEFT_OUT_PAGES, WALKS, Walk

from wetwell.services.reports.text_table import SCREEN_WIDTH

ROOT = Path(__file__).parents[2]
PORTS = ("7447", "8080", "5020", "5021", "9100")
"""Of the bus, the control-room page, two PLCs and the figures; a walk has its own."""
PATIENCE_S = 240
AGAIN_S = 2.0
"""Between two tries of a command; each starts a process."""
FOR_PROGRAMS = ("--json", "wetwell schema", "wetwell modbus-map", "wetwell config show", "--show-completion")
"""In commands that print what programs read."""
FIGURE = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?")
"""A number; not one that is part of a name."""


def blocks(page: Path, language: str) -> list[str]:
    """Fenced blocks of a page in a language, without the indent of a list."""
    text = page.read_text(encoding="utf-8")
    found = re.findall(rf"^( *)```{language}\n(.*?)^ *```", text, flags=re.MULTILINE | re.DOTALL)
    return [re.sub(rf"^{indent}", "", block, flags=re.MULTILINE) for indent, block in found]


def commands(page: Path) -> list[str]:
    """Commands of the shell blocks of a page, each with the text that it reads."""
    line_or_text = re.compile(r"^.*<<'(\w+)'\n(?:.*\n)*?\1$|^.+$", re.MULTILINE)
    return [found[0] for block in blocks(page, "sh") for found in line_or_text.finditer(block)]


def lines_of(text: str) -> list[str]:
    """Lines of a text without their spacing, which tables fit to their longest row."""
    return [" ".join(line.split()) for line in text.splitlines() if line.strip()]


def too_wide(line: str, printed: str) -> list[str]:
    """What a command of ours prints for people and is wider than a screen, single words apart."""
    if not line.startswith("wetwell ") or any(form in line for form in FOR_PROGRAMS):
        return []
    return [shown for shown in printed.splitlines() if len(shown) > SCREEN_WIDTH and len(shown.split()) > 1]


def is_said(shown: str, printed: str, near: float) -> bool:
    """Whether a line of a page is the printed one, each figure within a share of it."""
    if shown == printed or not near or FIGURE.sub("#", shown) != FIGURE.sub("#", printed):
        return shown == printed
    figures = (map(float, FIGURE.findall(line)) for line in (shown, printed))
    return all(math.isclose(one, other, rel_tol=near) for one, other in zip(*figures, strict=True))


def pages_with_commands() -> Iterator[str]:
    """Pages of README and docs that have blocks of shell or Python."""
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
        if commands(page) or blocks(page, "python"):
            yield page.relative_to(ROOT).as_posix()


def test_every_page_with_commands_is_walked_or_left_out_for_a_reason() -> None:
    walked = [page for walk in WALKS for page in walk.pages]
    assert sorted([*walked, *LEFT_OUT_PAGES]) == sorted(pages_with_commands())


def test_commands_stand_in_shell_blocks_where_a_walk_finds_them() -> None:
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
        found = re.findall(r"^ *```(\w*)\n(.*?)^ *```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
        lines = [line for language, block in found if language != "sh" for line in block.splitlines()]
        assert [line for line in lines if re.match(r" *wetwell (-|[a-z])", line)] == [], page


def test_what_is_said_of_a_walk_is_in_its_pages() -> None:
    for walk in WALKS:
        lines = [f"{line}\n" for page in walk.pages for line in commands(ROOT / page)]
        for beginning in (*walk.services, *walk.patient, *walk.left_out):
            assert any(line.startswith(beginning) for line in lines), beginning
        for text in walk.changed:
            assert any(text in line for line in lines), text


@pytest.mark.parametrize(
    ("printed", "near", "is_same"),
    [
        ("gap 1.02 after, pump_1_at_80", 0.0, True),
        ("gap 1.03 after, pump_1_at_80", 0.0, False),
        ("gap 1.03 after, pump_1_at_80", 0.1, True),
        ("gap 1.30 after, pump_1_at_80", 0.1, False),
        ("gap -1.02 after, pump_1_at_80", 0.1, False),
        ("gap 1.02 after, pump_1_at_70", 0.1, False),
        ("gap 1.02 before, pump_1_at_80", 0.1, False),
    ],
)
def test_a_line_of_a_page_is_what_is_printed_but_for_the_share_that_its_walk_allows(
    printed: str, near: float, is_same: bool
) -> None:
    assert is_said("gap 1.02 after, pump_1_at_80", printed, near) == is_same


@pytest.mark.parametrize(
    ("line", "printed", "is_wide"),
    [
        ("wetwell doctor", "a " * 51, True),
        ("wetwell doctor", "a " * 50, False),
        ("wetwell doctor", "a" * 101, False),
        ("wetwell doctor --json", "a " * 51, False),
        ("cat field.csv", "a " * 51, False),
    ],
)
def test_what_people_read_fits_a_screen(line: str, printed: str, is_wide: bool) -> None:
    assert bool(too_wide(line, printed)) == is_wide


@pytest.mark.check
@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    "walk",
    [
        pytest.param(walk, id=walk.pages[0].removeprefix("docs/"), marks=pytest.mark.long if walk.is_long else ())
        for walk in WALKS
    ],
)
def test_commands_run(walk: Walk, tmp_path: Path) -> None:
    ports = free_ports()
    environment = environment_of(tmp_path, ports)
    lines = [line for page in walk.pages for line in commands(ROOT / page)]
    lines = [line for line in lines if not f"{line}\n".startswith(tuple(walk.left_out))]
    started: list[tuple[subprocess.Popen[bytes], Path]] = []
    printed: list[str] = []
    try:
        if walk.given:
            run(walk.given, tmp_path, environment)
        for line in (*walk.before, *lines):
            run_line = line
            for text, other in (*walk.changed.items(), *ports.items()):
                run_line = run_line.replace(text, other)
            if line.startswith((*walk.before, *walk.services)):
                said = tmp_path / f"service-{len(started)}.log"
                with said.open("wb") as log:
                    command = ["/bin/sh", "-c", f"exec {run_line}"]
                    process = subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=log, stderr=log)
                started.append((process, said))
            else:
                code = next((code for beginning, code in walk.codes.items() if line.startswith(beginning)), 0)
                patience_s = PATIENCE_S if line.startswith(walk.patient) else 0.0
                said_now = run(run_line, tmp_path, environment, code, patience_s)
                assert too_wide(line, said_now) == []
                printed += lines_of(said_now)
        for block in (block for page in walk.pages for block in blocks(ROOT / page, "python")):
            run(f"python - <<'PYTHON'\n{block}PYTHON\n", tmp_path, environment)
        for process, said in started:
            wait_for_a_word(process, said)
    finally:
        codes = [code_at_the_end(process) for process, _ in reversed(started)]
    assert codes == [0] * len(started), [said.read_text() for _, said in started]
    if walk.shows_output:
        shown = [line for page in walk.pages for block in blocks(ROOT / page, "text") for line in lines_of(block)]
        assert shown
        missed = [line for line in shown if not any(is_said(line, said, walk.near) for said in printed)]
        assert missed == [], "\n".join(printed)


def code_at_the_end(process: subprocess.Popen[bytes]) -> int:
    """Exit code of a service that Ctrl-C ends; 0 of a page's own program that does not come to an end."""
    process.send_signal(signal.SIGINT)
    try:
        return process.wait(60)
    except subprocess.TimeoutExpired:
        process.kill()
        code = process.wait()
        return 0 if "exec python " in str(process.args) else code


def wait_for_a_word(process: subprocess.Popen[bytes], said: Path) -> None:
    """Wait until a service has told that it is there."""
    deadline = time.monotonic() + PATIENCE_S
    while not said.stat().st_size:
        assert process.poll() is None, process.args
        assert time.monotonic() < deadline, process.args
        time.sleep(0.1)
    assert process.poll() is None, said.read_text()


def free_ports() -> dict[str, str]:
    """A free port for each of the usual ones."""
    return {port: str(free_port()) for port in PORTS}


def environment_of(folder: Path, ports: dict[str, str]) -> dict[str, str]:
    """Environment in which `wetwell` and `python` are those of the test, and services take its ports."""
    bus, page, plc, *_ = ports.values()
    binaries = folder / "bin"
    binaries.mkdir()
    (binaries / "wetwell").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m wetwell.services "$@"\n')
    (binaries / "python").write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    for binary in binaries.iterdir():
        binary.chmod(0o755)
    return os.environ | {
        "PATH": f"{binaries}:{os.environ['PATH']}",
        "ROOT": str(ROOT),
        "WETWELL_ZENOH__ENDPOINT": f"tcp/127.0.0.1:{bus}",
        "WETWELL_DASHBOARD__PORT": page,
        "WETWELL_MODBUS__PORT": plc,
    }


def run(line: str, folder: Path, environment: dict[str, str], code: int = 0, patience_s: float = 0.0) -> str:
    """What a line of a page prints; where it may be too early, it is run until it succeeds."""
    deadline = time.monotonic() + patience_s
    while True:
        done = subprocess.run(
            ["/bin/sh", "-e", "-c", line],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        if done.returncode == code:
            return done.stdout
        assert time.monotonic() < deadline, f"{line}\n{done.stdout}{done.stderr}"
        time.sleep(AGAIN_S)
