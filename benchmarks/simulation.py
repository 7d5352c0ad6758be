"""Station-days of whole sites on a virtual clock, with accidents: one JSON object on standard output.

python benchmarks/simulation.py --sites 500 --workers 2
python benchmarks/simulation.py --sites 18250 --stations 1 --workers 2 --hours 8   # a night: as many as it can
python benchmarks/simulation.py --first-seed SEED --sites 1 --shrink   # a seed that failed, as the shortest test
python benchmarks/simulation.py --kind alpha --period-s 60 --stations 5 --sites 10
"""

import argparse
import gc
import itertools
import json
import math
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "simulation"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

from accidents import Plan, plan_of
from rules import broken_rules
from shrinking import as_test, shrunk
from site_kinds import KINDS

Task = tuple[str, int, int, float, int]
"""Kind of a site, its seed, stations and days, and the period of the poll."""
Lived = tuple[int, list[str], Counter[str], float]
MEMORY = Path("/dev/shm")  # noqa: S108 -- each site has a folder of its own there


def lived(task: Task) -> Lived:
    """Seed, broken rules, accidents and seconds of one core of a site."""
    begin_s = time.process_time()
    rules, accidents = life_of(task)
    return task[1], rules, Counter(accidents), time.process_time() - begin_s


def all_lived(tasks: list[Task], workers: int, end_s: float) -> Iterator[Lived]:
    """The same of many sites, in their order, none begun once the clock is at its end; one worker is this process."""
    if workers == 1:
        yield from map(lived, itertools.takewhile(lambda _: time.perf_counter() < end_s, tasks))
        return
    with ProcessPoolExecutor(workers) as pool:
        for one in pool.map(lived, tasks):
            yield one
            if time.perf_counter() >= end_s:
                pool.shutdown(cancel_futures=True)
                return


def life_of(task: Task, plan: Plan | None = None) -> tuple[list[str], list[str]]:
    """Broken rules and accidents of a site; without a plan with that of its seed."""
    kind, seed, stations, days, period_s = task
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder:
        site = KINDS[kind](seed, stations, days, period_s, Path(folder), plan)
        try:
            rules = broken_rules(site)
        except Exception as error:  # noqa: BLE001 - what was kept cannot be read: a broken rule, too
            rules = [f"it ended with {error!r}"]
        life = rules, site.accidents
    del site
    gc.collect()  # a site is full of circles, and the detector has frozen what was there when it began
    return life


def shortest_test(task: Task, rule: str) -> str:
    """The shortest test of a seed that still breaks the rule."""
    kind, seed, stations, days, period_s = task
    plan = shrunk(lambda plan: life_of(task, plan)[0], plan_of(seed, days * 86_400.0), rule)
    return as_test(kind, seed, stations, days, period_s, plan)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kind", choices=sorted(KINDS), default="light", help="of stations")
    parser.add_argument("--sites", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--stations", type=int, default=10, help="of each site")
    parser.add_argument("--days", type=float, default=2.0)
    parser.add_argument("--period-s", type=int, default=300)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--hours", type=float, default=math.inf, help="after which no further site begins")
    parser.add_argument("--shrink", action="store_true", help="print the shortest test of what breaks a rule")
    given = parser.parse_args()
    begin_s = time.perf_counter()
    tasks = [
        (given.kind, seed, given.stations, given.days, given.period_s)
        for seed in range(given.first_seed, given.first_seed + given.sites)
    ]
    accidents: Counter[str] = Counter()
    broken: dict[int, list[str]] = {}
    sites, cpu_s = 0, 0.0
    for seed, rules, happened, seconds in all_lived(tasks, given.workers, begin_s + 3600.0 * given.hours):
        sites += 1
        accidents.update(happened)
        cpu_s += seconds
        if rules:
            broken[seed] = rules
            print(f"seed {seed}: {rules[0]}", file=sys.stderr, flush=True)
    for task in tasks if given.shrink else ():
        if task[1] in broken:
            print(shortest_test(task, broken[task[1]][0]), file=sys.stderr)
    result = {
        "sites": sites,
        "station_days": sites * given.stations * given.days,
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
