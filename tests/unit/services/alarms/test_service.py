"""When the alarms of a site are written and told."""

import pytest
from alarm_site import Site

from wetwell.services.alarms.service import SAVING_SHARE, AlarmService, Kept
from wetwell.services.alarms.state_file import KeptSite
from wetwell.services.security.audit import Audit


class SlowPlace:
    """A place for a state that takes long to write."""

    def __init__(self, site: Site, write_s: float) -> None:
        self._site, self._write_s = site, write_s
        self.writes = 0

    def read(self) -> None:
        return None

    def write(self, _: bytes) -> None:
        self._site.wall_s += self._write_s
        self.writes += 1


@pytest.fixture(params=[0.0, 0.004, 0.2])
def slow(request):
    """A site whose state takes so long to write, its place, and that time."""
    site = Site()
    place = SlowPlace(site, request.param)
    kept = Kept(KeptSite(place), Audit(None))
    site.service = AlarmService(site.bus, site.settings, (), site.now, kept)
    return site, place, request.param


def change(site: Site, number: int) -> None:
    """Something to keep and to tell, each time."""
    now_ns = site.now().wall_ns
    site.service.registry.observe("alpha", "samples_stale", number % 2 == 0, now_ns, now_ns)
    assert site.service.registry.changed


def test_a_state_that_takes_long_to_write_is_not_written_all_the_time(slow):
    site, place, write_s = slow
    before_s, count, batch_s = site.wall_s, place.writes, 0.05
    for number in range(200):
        change(site, number)
        site.service.commit_in_time()
        site.wall_s += batch_s
    written_s = (place.writes - count) * write_s
    assert written_s <= SAVING_SHARE * (site.wall_s - before_s) + write_s
    if write_s <= SAVING_SHARE * batch_s:
        assert place.writes - count == 200


def test_what_waits_is_kept_and_told_with_an_act_at_once_and_with_a_look_in_time(slow):
    site, place, write_s = slow
    site.service.commit()
    for number, (then, waits_s) in enumerate(
        ((site.service.look, write_s / SAVING_SHARE), (site.service.commit, 0.0))
    ):
        change(site, number)
        site.service.commit_in_time()
        change(site, number + 1)
        site.service.commit_in_time()
        before = place.writes
        change(site, number)
        site.wall_s += waits_s
        then()
        assert place.writes == before + 1
        assert not site.service.registry.changed
