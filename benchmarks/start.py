"""How long `wetwell up` takes from its start to the page and to the first sample, with kernels on disk and without.

    python benchmarks/start.py --starts 3

`page_s` is the time until the page answers, `plant_s` until the first sample is on it, `cpu_s` what all processes
used until then. A loaded machine takes longer on the wall: `load` is said, and `cpu_s` hardly depends on it.
"""

import argparse
import json
import os
import platform
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

from site_processes import cpu_and_memory

STEP_S = 0.02
PATIENCE_S = 600.0


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return int(free.getsockname()[1])


def answer(url: str) -> bytes | None:
    try:
        with urllib.request.urlopen(url, timeout=5.0) as page:  # noqa: S310 - our own address
            return bytes(page.read())
    except OSError:
        return None


def tree(pid: int) -> list[int]:
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [pid, *(each for child in children for each in tree(int(child)))]


def start(folder: Path, environment: dict[str, str]) -> dict[str, float]:
    port = free_port()
    command = [sys.executable, "-m", "wetwell.services", "up", "--data", str(folder / "data")]
    command += ["--zenoh", f"tcp/127.0.0.1:{free_port()}", "--modbus", f"127.0.0.1:{free_port()}"]
    begin_s = time.monotonic()
    process = subprocess.Popen(  # noqa: S603 - our own command
        [*command, "--page", f"127.0.0.1:{port}"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment
    )
    result: dict[str, float] = {}
    while "plant_s" not in result:
        if time.monotonic() - begin_s > PATIENCE_S or process.poll() is not None:
            raise SystemExit("it does not start")
        if "page_s" not in result and answer(f"http://127.0.0.1:{port}/") is not None:
            result["page_s"] = time.monotonic() - begin_s
        state = answer(f"http://127.0.0.1:{port}/api/stations/alpha") if "page_s" in result else None
        if state is not None and json.loads(state)["rows"]:
            result["plant_s"] = time.monotonic() - begin_s
        time.sleep(STEP_S)
    result["cpu_s"] = sum(cpu_and_memory(each)[0] for each in tree(process.pid))
    process.send_signal(signal.SIGINT)
    said = process.communicate()[1].decode()
    return {name: round(value, 2) for name, value in result.items()} | {"lines_said": len(said.splitlines())}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=3, help="of each kind")
    arguments = parser.parse_args()
    result: dict[str, object] = {"load_before": os.getloadavg()[0]}
    with tempfile.TemporaryDirectory(prefix="wetwell-start-") as name:
        folder = Path(name)
        for kind in ("cold", "warm"):
            starts = []
            for number in range(arguments.starts):
                cache = folder / (f"kernels-{number}" if kind == "cold" else "kernels-0")
                (each := folder / f"{kind}-{number}").mkdir()
                starts.append(start(each, os.environ | {"NUMBA_CACHE_DIR": str(cache)}))
            result[kind] = starts
    result["load_after"] = os.getloadavg()[0]
    result["machine"] = {"cores": os.cpu_count(), "python": platform.python_version()}
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
