"""The whole service on a virtual clock, with accidents from a seed. A seed that fails becomes a test by

python benchmarks/simulation.py --kind alpha --period-s PERIOD --stations N --first-seed SEED --sites 1 --shrink
"""

from collections import Counter
from itertools import pairwise

import pytest
from accidents import KINDS, Accident, plan_of
from rules import broken_rules, fingerprint
from site_kinds import alpha_site, light_site


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_a_site_that_is_asked_each_ten_seconds_tells_and_keeps_all_whatever_befalls_it(folder, seed):
    assert broken_rules(alpha_site(seed, 2, 1.0, 10, folder)) == []


def test_a_seed_gives_the_same_events_again(folder):
    sites = [alpha_site(9, 1, 0.5, 60, folder / name) for name in ("first", "second")]
    assert fingerprint(sites[0]) == fingerprint(sites[1])


@pytest.mark.long
@pytest.mark.timeout(900)  # half a minute of one quiet core
def test_many_seeds_see_every_accident(folder):
    happened: Counter[str] = Counter()
    for seed in range(100, 106):
        site = alpha_site(seed, 2, 2.0, 60, folder / str(seed))
        assert broken_rules(site) == [], f"seed {seed}"
        happened.update(accident.split()[0] for accident in site.accidents)
    assert set(happened) == set(KINDS)


def test_plans_have_every_kind_and_target_and_overlap():
    plans = [plan_of(seed, 172_800.0) for seed in range(200)]
    assert {(one.kind, one.target) for plan in plans for one in plan} == {
        (kind, target) for kind, targets in KINDS.items() for target in targets
    }
    assert plans == [plan_of(seed, 172_800.0) for seed in range(200)]
    overlaps = [later.at_s < before.at_s + before.lasts_s for plan in plans for before, later in pairwise(plan)]
    assert sum(overlaps) > 1_000
    kinds = [len({one.kind for one in plan}) for plan in plans]
    assert min(kinds) < 5
    assert max(kinds) > 11


def test_a_process_that_stands_since_its_begin_has_no_folder_yet_that_a_second_could_share(folder):
    plan = (
        Accident(kind="stall", target="historian", at_s=1_000.0, lasts_s=4_000.0, seed=1),
        Accident(kind="hole", target="historian", at_s=2_000.0, lasts_s=1.0, seed=1),  # it begins again, and stands
        Accident(kind="twin", target="historian", at_s=3_000.0, lasts_s=100.0, seed=1),
    )
    assert light_site(7, 1, 0.1, 300, folder, plan).crashes == []
