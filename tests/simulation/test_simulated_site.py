"""The whole service on a virtual clock, with accidents from a seed. A seed that fails, fails again:

python benchmarks/simulation.py --first-seed SEED --sites 1
"""

import logging
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from rules import broken_rules, fingerprint
from simulated_site import ACCIDENTS, Site, alpha_site
from virtual_loop import run_virtual


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """In memory where that can be: what a crash of the machine does to its disks is not simulated."""
    memory = Path("/dev/shm")  # noqa: S108 -- its folder there has a name of its own
    if not memory.is_dir():
        yield tmp_path
        return
    with tempfile.TemporaryDirectory(dir=memory, prefix="wetwell-") as name:
        yield Path(name)


def lived(folder: Path, seed: int, stations: int, days: float, period_s: int) -> Site:
    site = alpha_site(seed, stations, days, period_s, folder)
    run_virtual(site.live())
    return site


@pytest.fixture(autouse=True)
def quiet(caplog):
    caplog.set_level(logging.CRITICAL)


@pytest.mark.parametrize("seed", range(4))
def test_a_site_that_is_asked_each_ten_seconds_tells_and_keeps_all_whatever_befalls_it(folder, seed):
    assert broken_rules(lived(folder, seed, stations=2, days=1.0, period_s=10)) == []


def test_a_seed_gives_the_same_events_again(folder):
    sites = [lived(folder / name, 9, stations=1, days=0.5, period_s=60) for name in ("first", "second")]
    assert fingerprint(sites[0]) == fingerprint(sites[1])


@pytest.mark.timeout(900)  # 90 s on two quiet cores
def test_many_seeds_see_every_accident(folder):
    happened: Counter[str] = Counter()
    for seed in range(100, 105):
        site = lived(folder / str(seed), seed, stations=5, days=2.0, period_s=60)
        assert broken_rules(site) == [], f"seed {seed}"
        happened.update(site.accidents)
    assert set(happened) == set(ACCIDENTS)
