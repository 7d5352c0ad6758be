"""What befalls a simulated site: a plan from a seed, in which accidents of many kinds overlap."""

import math
import random
from collections.abc import Mapping
from dataclasses import dataclass

BETWEEN_S = (172_800.0, 43_200.0, 14_400.0)
"""Mean time between two accidents of a kind, of which a seed has rolled one: rare to constant."""
OF_FILES = {"rot", "misdirected", "hole", "stale"}
FILES_BETWEEN_S = (43_200.0, 10_800.0, 2_700.0)
"""The same of these: most of a file is read by nobody for hours."""
IS_OFF = 0.5
"""Share of kinds that a seed has none of: what hides another is away at times."""
SHORTEST_S, LONGEST_S = 1.0, 7_200.0
AFTER_S = 60.0
"""Between the end of all accidents and the last sample."""
CLOCK_STEP_S = 3_600.0
SLOW_S = 20.0
"""How long a write waits for a slow disk."""

DAEMONS = ("gateway", "detector", "historian", "alarms")
KEEPERS = ("detector", "historian", "alarms")
"""What has a disk: all three on one machine."""

KINDS: Mapping[str, tuple[str, ...]] = {
    "kill": DAEMONS,
    "stop": DAEMONS,
    "stall": DAEMONS,
    "cut": DAEMONS,
    "mute": DAEMONS,
    "deaf": DAEMONS,
    "twin": KEEPERS,
    "backup": KEEPERS,
    "rot": KEEPERS,
    "misdirected": KEEPERS,
    "hole": KEEPERS,
    "stale": KEEPERS,
    "power": ("machine", "site"),
    "lie": ("machine",),
    "full": ("machine",),
    "slow": ("machine",),
    "plc": ("away", "silent", "refuses"),
    "clock": ("ahead", "back"),
    "clock-restart": ("ahead", "back"),
}


@dataclass(frozen=True)
class Accident:
    """One accident: what, to whom, from when on and how long [s], and the seed of what else chance decides."""

    kind: str
    target: str
    at_s: float
    lasts_s: float
    seed: int = 0


Plan = tuple[Accident, ...]


def plan_of(seed: int, seconds: float) -> Plan:
    """Accidents of a site that lives so long, in the order of their beginnings. The same seed has the same."""
    dice = random.Random(f"accidents {seed}")
    plan = []
    for kind, all_targets in KINDS.items():
        if dice.random() < IS_OFF:
            continue
        between_s, at_s = dice.choice(FILES_BETWEEN_S if kind in OF_FILES else BETWEEN_S), 0.0
        targets = dice.sample(all_targets, dice.randint(1, len(all_targets)))  # some are spared for all of a life
        while (at_s := at_s + dice.expovariate(1.0 / between_s)) < seconds - AFTER_S:
            lasts_s = math.exp(dice.uniform(math.log(SHORTEST_S), math.log(LONGEST_S)))
            lasts_s = min(lasts_s, seconds - AFTER_S - at_s)
            plan.append(
                Accident(kind, dice.choice(targets), round(at_s, 1), round(lasts_s, 1), dice.randrange(10**6))
            )
    return tuple(sorted(plan, key=lambda accident: accident.at_s))
