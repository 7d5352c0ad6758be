"""A pair of daemons on a real PostgreSQL: its owner is killed, frozen, cut off, and gets a wrong clock."""

import asyncio

from pair_site import PairSite, stations_of

LIMIT_S = 3.0
SPEED = 100.0


def test_of_two_detectors_one_tells_each_verdict_once_whatever_happens_to_it(postgres, tmp_path):
    site = PairSite(postgres.url, tmp_path, stations_of(tmp_path, 3), SPEED, seed=11)

    async def run():
        async with site.running("a", "b"):
            await asyncio.sleep(1.0)  # real processes: there is no virtual time here
            taken = {kind: (await site.disturb(kind))[1] for kind in ("freeze", "cut", "clock", "kill")}
            await asyncio.sleep(1.0)
            await site.end_of_samples()
            await asyncio.sleep(2.0)
        return taken

    taken = asyncio.run(run())
    judged = site.judged()
    assert judged.expected > 9  # three pumps a station say at first that they learn
    assert (judged.missing, judged.twice, judged.otherwise) == (0, 0, 0)
    assert min(taken["freeze"], taken["cut"], taken["kill"]) > 0.0
