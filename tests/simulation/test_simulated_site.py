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
from simulated_site import ACCIDENTS, Site
from virtual_loop import run_virtual

from wetwell.services.presets import find_scenario


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """In memory where that can be: what a crash of the machine does to its disks is not simulated."""
    memory = Path("/dev/shm")  # noqa: S108 -- its folder there has a name of its own
    if not memory.is_dir():
        yield tmp_path
        return
    with tempfile.TemporaryDirectory(dir=memory, prefix="wetwell-") as name:
        yield Path(name)


def lived(alpha, folder: Path, seed: int, stations: int, days: float, period_s: int) -> Site:
    site = Site(
        seed=seed,
        stations=[alpha.model_copy(update={"name": f"station-{number}"}) for number in range(stations)],
        scenario=find_scenario("paper"),
        seconds=round(days * 86_400.0),
        period_s=period_s,
        folder=folder,
    )
    run_virtual(site.live())
    return site


@pytest.fixture(autouse=True)
def quiet(caplog):
    caplog.set_level(logging.CRITICAL)


@pytest.mark.parametrize("seed", range(4))
def test_a_site_that_is_asked_each_ten_seconds_tells_and_keeps_all_whatever_befalls_it(alpha, folder, seed):
    assert broken_rules(lived(alpha, folder, seed, stations=2, days=1.0, period_s=10)) == []


def test_a_seed_gives_the_same_events_again(alpha, folder):
    sites = [lived(alpha, folder / name, 9, stations=1, days=0.5, period_s=60) for name in ("first", "second")]
    assert fingerprint(sites[0]) == fingerprint(sites[1])


def test_many_seeds_see_every_accident(alpha, folder):
    happened: Counter[str] = Counter()
    for seed in range(100, 105):
        site = lived(alpha, folder / str(seed), seed, stations=5, days=2.0, period_s=60)
        assert broken_rules(site) == [], f"seed {seed}"
        happened.update(site.accidents)
    assert set(happened) == set(ACCIDENTS)
