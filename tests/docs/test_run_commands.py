"""Commands of tutorials and how-tos, really run in the order of the page, in a folder of its own."""

import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGES = ["add-a-station.md", "tutorial-connect-a-plc.md"]
BACKGROUND = "wetwell plc "
"""Runs while the rest of its page does."""
NOT_RUN = {
    "wetwell up": "runs for ever; tests/end_to_end/test_processes.py runs it",
    "wetwell router": "runs for ever; tests/integration/test_zenoh_link.py opens the same router",
    "wetwell gateway --plc": "runs for ever; tests/end_to_end/test_gateway.py",
    "wetwell detector --station": "runs for ever; tests/end_to_end/test_processes.py",
    "wetwell dashboard": "runs for ever; tests/integration/test_dashboard.py",
    "wetwell doctor": "needs a running site; tests/end_to_end/test_doctor.py",
    "wetwell detect ": "long on a first start, which compiles; tests/unit/test_cli.py",
    "wetwell simulate ": "long on a first start, which compiles; tests/unit/test_cli.py",
}


def commands(page: str) -> Iterator[str]:
    """Commands of the shell blocks of a page, each with the text that it reads."""
    text = (DOCS / page).read_text(encoding="utf-8")
    for block in re.findall(r"^```sh\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL):
        yield from (found[0] for found in re.finditer(r"^.*<<'(\w+)'\n(?:.*\n)*?\1$|^.+$", block, flags=re.MULTILINE))


@pytest.mark.parametrize("page", PAGES)
def test_commands_of_a_page_run(page: str, tmp_path: Path) -> None:
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "wetwell").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m wetwell.services "$@"\n')
    (folder / "wetwell").chmod(0o755)
    environment = os.environ | {"PATH": f"{folder}:{os.environ['PATH']}"}
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    lines = [line.replace("5020", str(port)) for line in commands(page)]
    script = "\n".join(line for line in lines if not line.startswith((BACKGROUND, *NOT_RUN)))
    started = [
        subprocess.Popen(["/bin/sh", "-c", f"exec {line}"], cwd=tmp_path, env=environment)
        for line in lines
        if line.startswith(BACKGROUND)
    ]
    try:
        if started:
            wait_for(port)
        done = subprocess.run(
            ["/bin/sh", "-e", "-c", script],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=100,
            check=False,
        )
    finally:
        for process in started:
            process.terminate()
            process.wait(20)
    assert script
    assert done.returncode == 0, done.stdout + done.stderr


def wait_for(port: int) -> None:
    """Wait until somebody listens."""
    for _ in range(300):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise TimeoutError(f"nobody listens on port {port}")
