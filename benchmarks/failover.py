"""A pair of detectors with a lease: its owner is killed, frozen, cut off or gets a wrong clock, again and again.

    python benchmarks/failover.py --rounds 200

Real processes, a real PostgreSQL in a folder of its own. Each member reaches router and database by lines of its own,
which `cut` lets carry nothing, in silence. Each accident is undone `--down-s` after the takeover. The next one comes
when the lease shows that the pair is whole, which takes `whole_after_s`; `--hurried` does not wait for that.
One that meets a pair that is not whole is `double`, and so are the verdicts that it held up. `late_s` is how long
after its sample a verdict came, of those whose sample came from the accident until the pair was whole, or the next.
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
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from detector_pair import Judged, Player, stations_of
from pair_site import DOWN_S, Accident, PairSite
from postgres_server import running_server

KINDS = ("kill", "freeze", "cut", "clock")
DOUBLE = "double"
LIMIT_S = 3.0
SHIFTS_S = (-86_400.0, -60.0, 60.0, 86_400.0)
SETTLE_S = 5.0


class Round(NamedTuple):
    """An accident, and until when [s] what fell due belongs to it."""

    accident: Accident
    end_s: float

    def held_up(self, due_s: float, late_s: float) -> bool:
        """Whether a verdict was due when it began or in it, and not there yet when it began."""
        return self.accident.began_s <= due_s + late_s and due_s <= self.end_s


async def measure(site: PairSite, player: Player, arguments: argparse.Namespace) -> dict[str, list[Round]]:
    """Rounds by kind; those that met a pair that was not whole under "double"."""
    shifts = random.Random(arguments.seed)
    found: dict[str, list[Round]] = {kind: [] for kind in (*arguments.kinds, DOUBLE)}
    async with site.running("a", "b"), player.playing(site.bus, site.endpoint):
        await asyncio.sleep(SETTLE_S)
        for number in range(arguments.rounds):
            for kind in arguments.kinds:
                accident = await site.disturb(
                    kind, shifts.choice(SHIFTS_S), down_s=arguments.down_s, waits=not arguments.hurried
                )
                whole_s = time.monotonic()
                await asyncio.sleep(arguments.apart_s)
                end_s = time.monotonic() if arguments.hurried else whole_s
                found[DOUBLE if accident.is_double else kind].append(Round(accident, end_s))
            print(f"round {number + 1} of {arguments.rounds}", file=sys.stderr)
        await asyncio.sleep(SETTLE_S)
        await player.end_of_samples()
        await player.all_heard()
    return found


def summary(late: list[float], rounds: list[Round]) -> dict[str, float | None]:
    taken = [one.accident.taken_after_s for one in rounds]
    whole = [one.accident.whole_after_s for one in rounds if one.accident.whole_after_s is not None]
    return {
        "rounds": len(rounds),
        "taken_over": sum(taken_s > 0.0 for taken_s in taken),
        "taken_after_s_median": round(float(np.median(taken)), 3),
        "taken_after_s_max": round(max(taken), 3),
        "whole_after_s_median": round(float(np.median(whole)), 3) if whole else None,
        "whole_after_s_max": round(max(whole), 3) if whole else None,
        "verdicts_due": len(late),
        "late_s_p99": round(float(np.quantile(late, 0.99)), 3) if late else None,
        "late_s_max": round(max(late), 3) if late else None,
        "later_than_3_s": sum(late_s > LIMIT_S for late_s in late),
    }


def summaries(judged: Judged, found: dict[str, list[Round]]) -> dict[str, dict[str, float | None]]:
    """Of each kind that there was. A verdict that a double accident held up counts there alone."""
    late: dict[str, list[float]] = {kind: [] for kind in found}
    for due_s, late_s in judged.late:
        if any(one.held_up(due_s, late_s) for one in found[DOUBLE]):
            late[DOUBLE].append(late_s)
            continue
        for kind, rounds in found.items():
            if any(one.accident.began_s <= due_s <= one.end_s for one in rounds):
                late[kind].append(late_s)
    return {kind: summary(late[kind], rounds) for kind, rounds in found.items() if rounds}


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
    parser.add_argument("--down-s", type=float, default=DOWN_S, help="from the takeover until the accident is undone")
    parser.add_argument("--hurried", action="store_true", help="do not wait until the pair is whole again")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="wetwell-failover-") as name, running_server() as server:
        folder = Path(name)
        stations = stations_of(folder, arguments.stations)
        files = (word for one in stations for word in ("--station", str(folder / f"{one.name}.toml")))
        site = PairSite(server.url, folder, ["detector", *files])
        player = Player(stations, arguments.speed, arguments.seed)
        rounds = asyncio.run(measure(site, player, arguments))
        judged = player.judged()
    counts = {name: getattr(judged, name) for name in ("expected", "missing", "twice", "otherwise", "plain_twice")}
    result = {
        "machine": f"{os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}",
        "load": round(os.getloadavg()[0], 1),
        **vars(arguments),
        "verdicts": counts,
        "late_s_median_all": round(float(np.median([late_s for _, late_s in judged.late])), 3),
        "late_s_max_all": round(max(late_s for _, late_s in judged.late), 3),
        **summaries(judged, rounds),
    }
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
