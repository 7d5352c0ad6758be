"""Station-days by the hundred on a virtual clock, with accidents from a seed. A seed that fails becomes a test by

python benchmarks/simulation.py --first-seed SEED --sites 1 --shrink
"""

import pytest
from rules import broken_rules
from site_kinds import light_site

pytestmark = [pytest.mark.check, pytest.mark.long]

SITES = 4
"""Of one test: 16 station-days with hundreds of accidents."""


@pytest.mark.timeout(600)  # a quarter of a minute of one quiet core
@pytest.mark.parametrize("first_seed", range(1000, 1052, SITES))
def test_no_rule_is_broken_in_hundreds_of_station_days(folder, first_seed):
    for seed in range(first_seed, first_seed + SITES):
        assert broken_rules(light_site(seed, 2, 2.0, 300, folder / str(seed))) == [], f"seed {seed}"
