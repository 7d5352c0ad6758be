"""The shortest plan of accidents that still breaks a rule, and a test that lives through it."""

import re
from collections.abc import Callable
from dataclasses import replace

from accidents import SHORTEST_S, Plan

Breaks = Callable[[Plan], list[str]]
"""Rules that a life with this plan breaks, in words."""


def shrunk(breaks: Breaks, plan: Plan, rule: str, most_lives: int = 200) -> Plan:
    """A plan from which nothing can be left out, and nothing cut shorter, without the rule holding again.

    First halves, then quarters and so on are left out (`ddmin` of Zeller and Hildebrandt, 2002); then each accident
    that is left is cut as short as can be.

    Parameters
    ----------
    breaks : callable
    plan : Plan
        One that breaks the rule.
    rule : str
        As `breaks` has said it; numbers in it do not count.
    most_lives : int
        After so many the best one until then is returned.
    """
    wanted = kind_of(rule)
    left = most_lives

    def is_broken(candidate: Plan) -> bool:
        nonlocal left
        left -= 1
        return left >= 0 and wanted in {kind_of(broken) for broken in breaks(candidate)}

    size = max(1, len(plan) // 2)
    while left > 0:
        for begin in range(0, len(plan), size):
            candidate = plan[:begin] + plan[begin + size :]
            if is_broken(candidate):
                plan = candidate
                break
        else:
            if size == 1:
                break
            size = max(1, size // 2)
            continue
        size = max(1, min(size, len(plan) // 2))
    for place, accident in enumerate(plan):
        candidate = (*plan[:place], replace(accident, lasts_s=SHORTEST_S), *plan[place + 1 :])
        if accident.lasts_s > SHORTEST_S and is_broken(candidate):
            plan = candidate
    return plan


def kind_of(rule: str) -> str:
    """A broken rule without its numbers and examples."""
    return re.sub(r"[0-9][0-9.]*", "#", rule.split(", such as", maxsplit=1)[0])


def as_test(kind: str, seed: int, stations: int, days: float, period_s: int, plan: Plan) -> str:
    """A test that lives through a plan."""
    accidents = "".join(f"        {accident!r},\n" for accident in plan)
    return (
        f"def test_seed_{seed}_breaks_no_rule(folder):\n"
        f"    plan = (\n{accidents}    )\n"
        f"    site = {kind}_site({seed}, {stations}, {days}, {period_s}, folder, plan)\n"
        f"    assert broken_rules(site) == []\n"
    )
