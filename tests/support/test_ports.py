"""A port is given once, though nobody listens on it yet."""

import subprocess
import sys
from pathlib import Path

import ports

FEW = 24


def test_no_port_is_given_twice_in_any_process(monkeypatch):
    monkeypatch.setattr(ports, "FIRST", 31_900)
    given = {ports.free_port() for _ in range(FEW)}
    other = "import ports; ports.FIRST = 31_900; print(*(ports.free_port() for _ in range(24)))"
    folder = Path(ports.__file__).parent
    told = subprocess.run([sys.executable, "-c", other], cwd=folder, capture_output=True, text=True, check=True)
    assert len(given | {int(port) for port in told.stdout.split()}) == 2 * FEW
