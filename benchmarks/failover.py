"""A pair of detectors with a lease: its owner is killed, frozen, cut off or gets a wrong clock, again and again.

    python benchmarks/failover.py --rounds 200

Real processes, a real PostgreSQL in a folder of its own. Each member reaches router and database by lines of its own,
which `cut` lets carry nothing, in silence. A frozen owner goes on half a second after the takeover. `late_s` is how
long after its sample a verdict came, of those whose sample came from the accident until both members stood again.
Verdicts are held against those of a detector that was never disturbed, byte by byte: `missing`, `twice`, `otherwise`.
`plain_twice` counts what a subscriber heard twice that knows nothing of numbered messages.
"""

import argparse
import asyncio
import json
import os
import platform
import random
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from detector_pair import Judged, Player, stations_of
from pair_site import PairSite
from postgres_server import running_server

KINDS = ("kill", "freeze", "cut", "clock")
LIMIT_S = 3.0
SHIFTS_S = (-86_400.0, -60.0, 60.0, 86_400.0)
SETTLE_S = 5.0


async def measure(
    site: PairSite, player: Player, kinds: list[str], rounds: int, seed: int, apart_s: float
) -> dict[str, list[tuple[float, float, float]]]:
    """Of each kind its rounds: when the accident was, when all was well again, after how long the lease was taken."""
    shifts = random.Random(seed)
    found: dict[str, list[tuple[float, float, float]]] = {kind: [] for kind in kinds}
    async with site.running("a", "b"), player.playing(site.bus, site.endpoint):
        await asyncio.sleep(SETTLE_S)
        for number in range(rounds):
            for kind in kinds:
                began_s, taken_s = await site.disturb(kind, shifts.choice(SHIFTS_S))
                found[kind].append((began_s, time.monotonic(), taken_s))
                await asyncio.sleep(apart_s)
            print(f"round {number + 1} of {rounds}", file=sys.stderr)
        await asyncio.sleep(SETTLE_S)
        await player.end_of_samples()
        await player.all_heard()
    return found


def summary(judged: Judged, rounds: list[tuple[float, float, float]]) -> dict[str, float | None]:
    late = [late_s for due_s, late_s in judged.late if any(begin_s <= due_s <= end_s for begin_s, end_s, _ in rounds)]
    taken = [taken_s for _, _, taken_s in rounds]
    return {
        "rounds": len(rounds),
        "taken_over": sum(taken_s > 0.0 for taken_s in taken),
        "taken_after_s_median": round(float(np.median(taken)), 3),
        "taken_after_s_max": round(max(taken), 3),
        "verdicts_due": len(late),
        "late_s_p99": round(float(np.quantile(late, 0.99)), 3) if late else None,
        "late_s_max": round(max(late), 3) if late else None,
        "later_than_3_s": sum(late_s > LIMIT_S for late_s in late),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=200, help="of each kind")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--stations", type=int, default=16)
    parser.add_argument("--speed", type=float, default=200.0, help="how many times as fast as life the samples come")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--apart-s", type=float, default=0.0, help="pause before the next accident, in which all recover"
    )
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="wetwell-failover-") as name, running_server() as server:
        folder = Path(name)
        stations = stations_of(folder, arguments.stations)
        files = (word for one in stations for word in ("--station", str(folder / f"{one.name}.toml")))
        site = PairSite(server.url, folder, ["detector", *files])
        player = Player(stations, arguments.speed, arguments.seed)
        rounds = asyncio.run(
            measure(site, player, list(arguments.kinds), arguments.rounds, arguments.seed, arguments.apart_s)
        )
        judged = player.judged()
    counts = {name: getattr(judged, name) for name in ("expected", "missing", "twice", "otherwise", "plain_twice")}
    result = {
        "machine": f"{os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}",
        "load": round(os.getloadavg()[0], 1),
        **vars(arguments),
        "verdicts": counts,
        "late_s_median_all": round(float(np.median([late_s for _, late_s in judged.late])), 3),
        "late_s_max_all": round(max(late_s for _, late_s in judged.late), 3),
        **{kind: summary(judged, found) for kind, found in rounds.items()},
    }
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
