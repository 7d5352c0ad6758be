"""How soon a router that was away is found again, on a virtual clock."""

import asyncio
import itertools

import pytest
from virtual_loop import run_virtual

from wetwell.protocols.bus.zenoh import link
from wetwell.protocols.errors import LinkError
from wetwell.services.runtime.connection import connect
from wetwell.services.runtime.settings import Settings

AWAY_S = 600.0


@pytest.fixture
def longest_wait(monkeypatch):
    """Longest wait between two tries of a daemon with some settings, while its router is away."""

    def of(**tables):
        tries = []

        async def opened(*_):
            tries.append(asyncio.get_running_loop().time())
            if tries[-1] < AWAY_S:
                raise LinkError("no router")

        monkeypatch.setattr(link, "_open_in_thread", opened)
        run_virtual(connect(Settings.model_validate(tables)))
        return max(later - sooner for sooner, later in itertools.pairwise(tries))

    return of


def test_a_member_of_a_pair_looks_for_its_router_as_often_as_a_lease_lasts(longest_wait):
    assert longest_wait(lease={"url": "postgresql://db.example/wetwell", "ttl_s": 3.0}) <= 3.0


def test_others_look_less_and_less_often_so_that_a_router_that_comes_back_is_not_flooded(longest_wait):
    assert 5.0 < longest_wait() <= 10.0
