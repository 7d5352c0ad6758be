"""How long commands take to start: their help, and until they refuse an input that is wrong.

What is refused is read before any work begins, so that this is the start-up that a command adds to its work.

    python benchmarks/startup.py [--rounds 5]

Prints JSON: seconds of the processor and on the wall, the least of the rounds. On an idle machine they are alike; on
a busy one the first still holds.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

COMMANDS = {
    "--help": 0,
    "--version": 0,
    "detect --help": 0,
    "up --zenoh udp": 2,
    "simulator no-station": 2,
    "plc no-station": 2,
    "replay no.csv --station alpha": 2,
    "router --zenoh udp": 2,
    "detector --zenoh udp": 2,
    "detector rebaseline --station alpha --pump 1 --by a --zenoh udp": 2,
    "detector release no-station": 2,
    "gateway --zenoh udp": 2,
    "gateway check no.toml": 2,
    "gateway read no.toml": 2,
    "alarms --zenoh udp": 2,
    "alarms list --zenoh udp": 2,
    "alarms report --zenoh udp": 2,
    "alarms acknowledge x --station alpha --by a --zenoh udp": 2,
    "alarms reset x --station alpha --by a --zenoh udp": 2,
    "alarms shelve x --station alpha --by a --minutes 1 --zenoh udp": 2,
    "alarms unshelve x --station alpha --by a --zenoh udp": 2,
    "alarms out-of-service x --station alpha --by a --zenoh udp": 2,
    "alarms in-service x --station alpha --by a --zenoh udp": 2,
    "alarms maintenance alpha --by a --zenoh udp": 2,
    "alarms stop alpha --by a --zenoh udp": 2,
    "alarms resume alpha --by a --zenoh udp": 2,
    "historian --zenoh udp": 2,
    "history --zenoh udp": 2,
    "maintenance add alpha --asset main --act a --by a --zenoh udp": 2,
    "maintenance list alpha --zenoh udp": 2,
    "dashboard --zenoh udp": 2,
    "fleet no-folder --zenoh udp": 2,
    "export no.toml --out x.csv": 2,
    "import no.csv": 2,
    "simulate no-station --out x.csv": 2,
    "dataset no-station --out x": 2,
    "convert no.csv --draft m.toml": 2,
    "prepare no.csv --out x.csv": 2,
    "calibrate no.csv --station alpha --out x.toml": 2,
    "validate no.csv --station alpha": 2,
    "kpi no.csv": 2,
    "detect no.csv --station alpha --out x": 2,
    "backtest no.csv --station alpha --out x": 2,
    "gap diagnose no.csv --station alpha --out x": 2,
    "gap replay no.csv --station alpha --out x": 2,
    "gap trial --out x --scheduler nowhere": 2,
    "gap families no-trial --learnt-on fine": 2,
    "gap experiment no-diagnosis": 2,
    "gap watch --zenoh udp": 2,
    "gap fleet no-folder --out x.json": 2,
    "doctor --config no.toml": 2,
    "station check no-station": 2,
    "station show no-station": 2,
    "config check no.toml": 2,
    "config show no.toml": 2,
    "modbus-map no-station": 2,
    "faults": 0,
    "inflows": 0,
    "effects": 0,
    "effects new --from no-diagnosis --name a --out x": 2,
    "schema": 0,
    "token new a --role viewer --config no.toml": 2,
    "token revoke a --config no.toml": 2,
    "token list --config no.toml": 2,
}
"""A start of each command, and the exit code that shows that it came as far as it should."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=5)
    rounds = parser.parse_args().rounds
    with tempfile.TemporaryDirectory() as folder:
        took = {words: _least(words, code, rounds, Path(folder)) for words, code in COMMANDS.items()}
    slowest = max(took, key=lambda words: took[words]["cpu_s"])
    print(json.dumps({"load": os.getloadavg()[0], "slowest": {slowest: took[slowest]}, "commands": took}, indent=2))


def _least(words: str, code: int, rounds: int, folder: Path) -> dict[str, float]:
    program = Path(sys.executable).with_name("wetwell")
    wall_s, cpu_s = [], []
    for _ in range(rounds):
        begun_s, before_s = time.perf_counter(), _children_s()
        done = subprocess.run([program, *words.split()], cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603
        wall_s.append(time.perf_counter() - begun_s)
        cpu_s.append(_children_s() - before_s)
        if done.returncode != code:
            raise SystemExit(f"wetwell {words}: exit code {done.returncode}, {code} was expected: {done.stderr}")
    return {"cpu_s": round(min(cpu_s), 3), "wall_s": round(min(wall_s), 3)}


def _children_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
