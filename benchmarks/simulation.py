"""Station-days of whole sites on a virtual clock, with accidents: one JSON object on standard output.

python benchmarks/simulation.py --sites 500 --workers 2
python benchmarks/simulation.py --first-seed SEED --sites 1    # a seed that failed, again
python benchmarks/simulation.py --kind alpha --period-s 60 --stations 5 --sites 10
"""

import argparse
import json
import logging
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "simulation"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

from rules import broken_rules
from site_kinds import KINDS

MEMORY = Path("/dev/shm")  # noqa: S108 -- each site has a folder of its own there


def lived(task: tuple[str, int, int, float, int]) -> tuple[int, list[str], Counter[str], float]:
    """Seed, broken rules, accidents and seconds of one core of a site."""
    kind, seed, stations, days, period_s = task
    logging.disable(logging.CRITICAL)
    begin_s = time.process_time()
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder:
        site = KINDS[kind](seed, stations, days, period_s, Path(folder))
        return seed, broken_rules(site), Counter(site.accidents), time.process_time() - begin_s


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kind", choices=sorted(KINDS), default="light", help="of stations")
    parser.add_argument("--sites", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--stations", type=int, default=10, help="of each site")
    parser.add_argument("--days", type=float, default=2.0)
    parser.add_argument("--period-s", type=int, default=300)
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args()
    begin_s = time.perf_counter()
    tasks = [
        (given.kind, seed, given.stations, given.days, given.period_s)
        for seed in range(given.first_seed, given.first_seed + given.sites)
    ]
    accidents: Counter[str] = Counter()
    broken: dict[int, list[str]] = {}
    cpu_s = 0.0
    with ProcessPoolExecutor(given.workers) as pool:
        for seed, rules, happened, seconds in pool.map(lived, tasks):
            accidents.update(happened)
            cpu_s += seconds
            if rules:
                broken[seed] = rules
                print(f"seed {seed}: {rules[0]}", file=sys.stderr)
    result = {
        "station_days": given.sites * given.stations * given.days,
        "kind": given.kind,
        "period_s": given.period_s,
        "first_seed": given.first_seed,
        "accidents": dict(accidents),
        "broken": broken,
        "cpu_s": round(cpu_s, 1),
        "wall_s": round(time.perf_counter() - begin_s, 1),
    }
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
