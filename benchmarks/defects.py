"""Puts defects of the project's past back, one at a time, and lets simulated sites look for them: JSON on stdout.

python benchmarks/defects.py --first-seed 70000 --budget-s 180 --list
python benchmarks/defects.py --first-seed 70000 --budget-s 180 --only "second detector"
"""

import argparse
import contextlib
import json
import os
import re
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from past_defects import PAST_DEFECTS, PastDefect

ROOT = Path(__file__).parents[1]
MOST_SITES = 10_000
MOST_S = 120.0
"""For one site without a defect: it takes a few."""
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


def looked_for(folder: Path, first_seed: int, budget_s: float) -> dict[str, object]:
    """What a copy of the project breaks within some seconds: seed and rule; None where nothing was found.

    A seed that breaks a rule without the defect, too, has not found it.
    """
    end_s = time.monotonic() + budget_s
    while (left_s := end_s - time.monotonic()) > 0.0 and (broken := first_broken(folder, first_seed, left_s)):
        seed, rule = broken
        if first_broken(ROOT, seed, MOST_S, sites=1) is None:
            return {"seed": seed, "rule": rule, "s": round(budget_s - end_s + time.monotonic(), 1)}
        first_seed = seed + 1
    return {"seed": None, "rule": None, "s": budget_s}


def first_broken(folder: Path, first_seed: int, most_s: float, sites: int = MOST_SITES) -> tuple[int, str] | None:
    """The first seed of which a copy of the project breaks a rule within some seconds, and the rule."""
    script = folder / "benchmarks" / "simulation.py"
    command = [sys.executable, str(script), "--stations", "2", "--sites", str(sites)]
    run = subprocess.Popen(  # noqa: S603 - our own script
        [*command, "--first-seed", str(first_seed)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": str(folder / "src")},
        cwd=folder,
        start_new_session=True,
    )
    try:
        is_told, _, _ = select.select([run.stderr], [], [], most_s)
        told = run.stderr.readline().decode() if is_told else ""
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(run.pid, signal.SIGKILL)  # it and its worker
        run.wait()
    broken = re.match(r"seed (\d+): (.*)", told)
    if told and broken is None:
        raise SystemExit(f"{script}: {told}")
    return None if broken is None else (int(broken[1]), broken[2][:200])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first-seed", type=int, default=70_000)
    parser.add_argument("--budget-s", type=float, default=180.0, help="for each defect")
    parser.add_argument("--only", default="", help="those whose name has this text")
    parser.add_argument("--list", action="store_true", help="print the defects, and look for none")
    given = parser.parse_args()
    chosen = [defect for defect in PAST_DEFECTS if given.only in defect.name]
    if given.list:
        print("\n".join(f"{defect.mended_in}  {defect.name}" for defect in chosen))
        return
    found: dict[str, dict[str, object]] = {}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for part in PARTS:  # with what is compiled, which a change of services does not touch
            shutil.copytree(ROOT / part, folder / part, symlinks=True)
        for defect in chosen:
            before = (folder / defect.path).read_text(encoding="utf-8")
            put_back(folder, defect)
            found[defect.name] = looked_for(folder, given.first_seed, given.budget_s)
            print(f"{defect.name}: {found[defect.name]}", file=sys.stderr)
            (folder / defect.path).write_text(before, encoding="utf-8")
    result = {
        "first_seed": given.first_seed,
        "budget_s": given.budget_s,
        "defects": len(chosen),
        "found": sum(one["seed"] is not None for one in found.values()),
        "of_each": found,
    }
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
