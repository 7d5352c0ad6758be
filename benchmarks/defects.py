"""Puts defects of the project's past back, one at a time, and lets simulated sites look for them: JSON on stdout.

python benchmarks/defects.py --first-seed 70000 --workers 2
python benchmarks/defects.py --first-seed 70000 --budget-s 180 --only "second detector"
python benchmarks/defects.py --list
"""

import argparse
import contextlib
import json
import math
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from past_defects import PAST_DEFECTS, PastDefect

ROOT = Path(__file__).parents[1]
MOST_SITES = 10_000
MOST_S = 120.0
"""Of a core for one site without a defect: it takes a few."""
HOUR_S = 3_600.0
"""Of each core, in which all defects are looked for."""
FURTHER = 1_000
"""Seeds further on from which defects are looked for that were not found."""
PARTS = ("benchmarks", "detector", "protocols", "services", "sim2real", "simulator", "src", "tests")


def put_back(folder: Path, defect: PastDefect) -> None:
    """Put a defect into a copy of the project.

    Raises
    ------
    SystemExit
        If the place is not there once: the code has moved on, and the list must follow.
    """
    path = folder / defect.path
    text = path.read_text(encoding="utf-8")
    if text.count(defect.now) != 1:
        raise SystemExit(
            f"past_defects.py: '{defect.name}': {defect.path} has its place {text.count(defect.now)} times"
        )
    path.write_text(text.replace(defect.now, defect.then), encoding="utf-8")


def looked_for(folder: Path, first_seed: int, budget_s: float) -> dict[str, Any]:
    """What a copy of the project breaks within some seconds of a core: seed and rule; None where nothing was found.

    A seed that breaks a rule without the defect, too, has not found it. The seconds are those that the processes had
    of a core, so that other work on the machine does not count.
    """
    spent_s, begin_seed = 0.0, first_seed
    while spent_s < budget_s:
        broken, seconds = first_broken(folder, begin_seed, budget_s - spent_s)
        spent_s += seconds
        if broken is None:
            break
        seed, rule = broken
        broken_without, seconds = first_broken(ROOT, seed, MOST_S, sites=1)
        spent_s += seconds
        if broken_without is None:
            return {"seed": seed, "rule": rule, "sites": seed - first_seed + 1, "s": round(spent_s, 1)}
        begin_seed = seed + 1
    return {"seed": None, "rule": None, "s": round(spent_s, 1)}


def looked_for_in_copy(defect: PastDefect, first_seed: int, budget_s: float) -> dict[str, Any]:
    """The same for a defect, put back into a copy of its own."""
    with copied() as folder:
        put_back(folder, defect)
        found = looked_for(folder, first_seed, budget_s)
    print(f"{defect.name}: {found}", file=sys.stderr)
    return found


def all_looked_for(
    pool: ThreadPoolExecutor, defects: Sequence[PastDefect], first_seed: int, budget_s: float
) -> dict[str, dict[str, Any]]:
    """What is found of each defect within some seconds of a core."""
    results = pool.map(lambda defect: looked_for_in_copy(defect, first_seed, budget_s), defects)
    return {defect.name: result for defect, result in zip(defects, results, strict=True)}


def found_in_an_hour(
    pool: ThreadPoolExecutor, defects: Sequence[PastDefect], first_seed: int, left_s: float
) -> dict[str, dict[str, Any]]:
    """The same, where what is found early leaves its time to the others, which go on with further seeds."""
    found: dict[str, dict[str, Any]] = {}
    open_ = list(defects)
    while open_ and left_s > MOST_S * len(open_):
        results = all_looked_for(pool, open_, first_seed, left_s / len(open_))
        left_s -= sum(one["s"] for one in results.values())
        for name, one in results.items():
            found[name] = one | {"s": round(one["s"] + found.get(name, {"s": 0.0})["s"], 1)}
        open_ = [defect for defect in open_ if found[defect.name]["seed"] is None]
        first_seed += FURTHER
    return found


@contextlib.contextmanager
def copied() -> Iterator[Path]:
    """Copy the project with what is compiled, which a change of services does not touch."""
    with tempfile.TemporaryDirectory() as place:
        for part in PARTS:
            shutil.copytree(ROOT / part, Path(place) / part, symlinks=True)
        yield Path(place)


def first_broken(
    folder: Path, first_seed: int, most_s: float, sites: int = MOST_SITES
) -> tuple[tuple[int, str] | None, float]:
    """The first seed of which a copy of the project breaks a rule, and the rule; seconds of a core that it took.

    None if that takes more seconds of a core than are given.
    """
    script = folder / "benchmarks" / "simulation.py"
    command = [sys.executable, str(script), "--stations", "2", "--sites", str(sites)]
    run = subprocess.Popen(  # noqa: S603 - our own script
        [*command, "--first-seed", str(first_seed)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": str(folder / "src")},
        cwd=folder,
    )
    limit_s = math.ceil(most_s)
    resource.prlimit(run.pid, resource.RLIMIT_CPU, (limit_s, limit_s))
    with run.stderr or contextlib.nullcontext() as stderr:
        told = "" if stderr is None else stderr.readline().decode()
        os.kill(run.pid, signal.SIGKILL)  # `kill` would wait for it, and nobody would know its seconds
        _, _, usage = os.wait4(run.pid, 0)
    run.returncode = 0  # it was waited for
    broken = re.match(r"seed (\d+): (.*)", told)
    if told and broken is None:
        raise SystemExit(f"{script}: {told}")
    return None if broken is None else (int(broken[1]), broken[2][:200]), usage.ru_utime + usage.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first-seed", type=int, default=70_000)
    parser.add_argument("--workers", type=int, default=1, help="defects that are looked for side by side")
    parser.add_argument(
        "--budget-s",
        type=float,
        help="of a core for each defect; without it all together have an hour of each worker, and share what is left",
    )
    parser.add_argument("--only", default="", help="those whose name has this text")
    parser.add_argument("--list", action="store_true", help="print the defects, and look for none")
    given = parser.parse_args()
    chosen = [defect for defect in PAST_DEFECTS if given.only in defect.name]
    if given.list:
        print("\n".join(f"{defect.mended_in}  {defect.name}" for defect in chosen))
        return
    begin_s = time.monotonic()
    with ThreadPoolExecutor(given.workers) as pool:
        if given.budget_s:
            found = all_looked_for(pool, chosen, given.first_seed, given.budget_s)
        else:
            found = found_in_an_hour(pool, chosen, given.first_seed, HOUR_S * given.workers)
    result = {
        "first_seed": given.first_seed,
        "workers": given.workers,
        "budget_s": given.budget_s,
        "wall_s": round(time.monotonic() - begin_s, 1),
        "load": os.getloadavg(),
        "defects": len(chosen),
        "found": sum(one["seed"] is not None for one in found.values()),
        "of_each": found,
    }
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
