"""The ledger and the lease in a real PostgreSQL: what the token lets in, and what the next owner finds."""

import asyncio
import contextlib
import threading
import time
import uuid

import psycopg
import pytest
from cut_line import CutLine
from memory_bus import MemoryBus

from wetwell.protocols.errors import ConfigError, LinkError
from wetwell.services.lease.database import LeaseDatabase
from wetwell.services.lease.ledger import Entry, LeaseLostError, Ledger, Numbered
from wetwell.services.lease.membership import Claim, Membership
from wetwell.services.lease.outbox import Outbox, OutboxPlace
from wetwell.services.lease.table import LeaseTable, standings
from wetwell.services.lease.tenure import Tenure
from wetwell.services.runtime.health.board import HealthBoard
from wetwell.services.runtime.settings import LeaseSettings

KEY = "wetwell/alpha/verdict/1"
TTL_S = 1.0
PATIENCE_S = 2.0


class Site:
    """A role of its own in the shared server, for members that live in this process."""

    def __init__(self, url):
        self.role = f"test/{uuid.uuid4().hex}"
        self.database = LeaseDatabase(url, None, PATIENCE_S)
        self.ledger = Ledger(self.database, self.role)

    def claim(self, name):
        return Claim(LeaseTable(self.database, self.role), name, TTL_S)


@pytest.fixture
def site(postgres):
    with contextlib.closing(Site(postgres.url)) as made:
        yield made


Site.close = lambda self: self.database.close()


async def taken(claim):
    while not await claim.take():  # noqa: ASYNC110 - it is another that lets go of it
        await asyncio.sleep(0.02)
    return claim.tenure.token


def test_the_table_does_what_the_pure_lease_says(site, postgres):
    async def run():
        a, b = site.claim("a"), site.claim("b")
        assert await a.take()
        assert not await b.take()
        assert await a.renew()
        await a.release()
        assert await b.take()
        assert not await a.renew()
        with psycopg.connect(postgres.url) as database:
            standing = next(one for one in standings(database) if one.role == site.role)
        assert (standing.lease.holder, standing.lease.token) == ("b", 2)
        assert {one.holder for one in standing.members} == {"a", "b"}

    asyncio.run(run())


def test_one_that_is_not_ready_does_not_show_that_it_stands_by_and_is_better_than_nobody(site, postgres):
    async def run():
        a, b = site.claim("a"), site.claim("b")
        assert await a.take()
        assert not await b.take(is_ready=False)
        with psycopg.connect(postgres.url) as database:
            standing = next(one for one in standings(database) if one.role == site.role)
        assert [one.holder for one in standing.members] == ["a"]
        await a.release()
        assert await b.take(is_ready=False)

    asyncio.run(run())


def test_a_member_shows_that_it_stands_by_when_it_could_go_on_at_once(site, postgres, monkeypatch):
    board = HealthBoard()
    monkeypatch.setattr("wetwell.services.lease.membership.BOARD", board)
    settings = LeaseSettings(url=postgres.url, group=uuid.uuid4().hex, member="b", ttl_s=TTL_S)
    has_heard = threading.Event()

    def shown():
        figures = {metric.name: [one.value for one in metric.samples] for metric in board.collect()}
        return figures.get("wetwell_stands_by"), figures.get("wetwell_is_owner")

    async def until_shown(*wanted):
        async with asyncio.timeout(10.0):
            while shown() != wanted:  # noqa: ASYNC110 - it looks by itself
                await asyncio.sleep(0.02)

    async def run():
        with contextlib.closing(Membership(settings, "detector")) as member:
            owner = Claim(LeaseTable(site.database, member.name), "a", 60.0)
            assert await owner.take()
            taking = asyncio.create_task(member.take(MemoryBus(), has_heard.is_set))
            await until_shown([0.0], [0.0])
            has_heard.set()
            await until_shown([1.0], [0.0])
            await owner.release()
            await taking
            assert shown() == ([0.0], [1.0])

    asyncio.run(run())


def test_of_many_that_ask_at_once_one_gets_the_lease(site, postgres):
    async def run():
        databases = [LeaseDatabase(postgres.url, None, 5.0) for _ in range(5)]
        claims = [Claim(LeaseTable(one, site.role), str(n), TTL_S) for n, one in enumerate(databases)]
        assert sum(await asyncio.gather(*(claim.take() for claim in claims))) == 1
        for one in databases:
            one.close()

    asyncio.run(run())


def test_an_owner_of_the_past_keeps_nothing_and_the_next_finds_what_was_told(site):
    async def run():
        a, b = site.claim("a"), site.claim("b")
        token = await taken(a)
        first = Entry(streams={KEY: b"8 bytes."}, messages=[Numbered(KEY, 0, b"zero"), Numbered(KEY, 1, b"one")])
        first.states["alpha"], first.lines = b"state", [(0, "line")]
        await site.ledger.enter(token, first, {KEY: 100})
        await site.ledger.enter(token, first, {KEY: 100})  # not known whether it is in
        await site.ledger.enter(token, Entry(sent={KEY: 1}), {KEY: 100})
        later = await taken(b)
        with pytest.raises(LeaseLostError, match=f"token {token} is over, the owner is b with token {later}"):
            await site.ledger.enter(token, Entry(messages=[Numbered(KEY, 2, b"two")], states={"alpha": b"old"}), {})
        with pytest.raises(LeaseLostError):
            await site.ledger.inherit(token)
        found = await site.ledger.inherit(later)
        assert found.states == {"alpha": b"state"}
        assert (found.lines, found.last_line) == (1, "line")
        told = found.told[KEY]
        assert (told.sent.source, told.sent.end, told.sent.payloads) == (b"8 bytes.", 1, (b"zero",))
        assert told.unsent == (b"one",)

    asyncio.run(run())


def test_messages_that_were_sent_are_kept_for_late_joiners_as_many_as_history_says(site):
    async def run():
        token = await taken(site.claim("a"))
        entry = Entry(streams={KEY: b"8 bytes."}, messages=[Numbered(KEY, n, str(n).encode()) for n in range(10)])
        await site.ledger.enter(token, entry, {KEY: 3})
        await site.ledger.enter(token, Entry(sent={KEY: 10}), {KEY: 3})
        told = (await site.ledger.inherit(token)).told[KEY]
        assert (told.sent.payloads, told.sent.end, told.unsent) == ((b"7", b"8", b"9"), 10, ())

    asyncio.run(run())


def test_an_outbox_sends_what_is_kept_and_its_successor_sends_the_rest_and_nothing_twice(site):
    bus = MemoryBus()

    async def outbox_of(claim):
        return Outbox(bus, site.ledger, await site.ledger.inherit(claim.tenure.token), lambda: claim.tenure)

    async def run():
        heard = bus.subscribe(KEY)
        a, b = site.claim("a"), site.claim("b")
        await taken(a)
        first = await outbox_of(a)
        publisher = first.publisher(KEY, history=100)
        OutboxPlace(first, "alpha").write(b"state")
        publisher.put(b"zero")
        await first.flush()
        assert await heard.receive() == [b"zero"]
        publisher.put(b"one")
        a.tenure = Tenure(a.tenure.token, time.monotonic() - 1.0)  # frozen between keeping and sending
        with pytest.raises(LeaseLostError):
            await first.flush()
        await taken(b)
        second = await outbox_of(b)
        assert OutboxPlace(second, "alpha").read() == b"state"
        publisher = second.publisher(KEY, history=100)
        publisher.put(b"one")  # judged again
        publisher.put(b"two")
        await second.flush()
        assert await heard.receive() == [b"one", b"two"]
        publisher.put(b"one")  # by now it would be a new message
        await second.flush()
        assert await heard.receive() == [b"one"]

    asyncio.run(run())


def test_an_outbox_with_nothing_new_lets_others_run(site):
    """As of a successor whose keys are known and that has nothing to send."""

    async def run():
        claim = site.claim("a")
        token = await taken(claim)
        await site.ledger.enter(token, Entry(streams={KEY: b"8 bytes."}), {})
        outbox = Outbox(MemoryBus(), site.ledger, await site.ledger.inherit(token), lambda: claim.tenure)
        outbox.publisher(KEY)
        running = asyncio.create_task(outbox.run())
        await asyncio.sleep(0.1)
        running.cancel()

    asyncio.run(asyncio.wait_for(run(), 5.0))


def test_an_answer_goes_out_when_what_it_says_is_kept(site):
    async def run():
        claim = site.claim("a")
        await taken(claim)
        outbox = Outbox(MemoryBus(), site.ledger, await site.ledger.inherit(claim.tenure.token), lambda: claim.tenure)
        replies = []
        outbox.write_down("acknowledged")
        outbox.then(lambda: replies.append("done"))
        assert replies == []
        await outbox.flush()
        assert replies == ["done"]
        assert (await site.ledger.inherit(claim.tenure.token)).last_line == "acknowledged"
        await taken(site.claim("b"))
        outbox.write_down("shelved")
        outbox.then(lambda: replies.append("never"))
        with pytest.raises(LeaseLostError):
            await outbox.flush()
        assert replies == ["done"]

    asyncio.run(run())


def test_a_transaction_that_is_frozen_holds_nobody_up(site):
    """As a process that is stopped between its check of the token and its commit."""
    woken = threading.Event()

    def frozen(database):
        database.execute("SELECT token FROM wetwell.lease WHERE role = %s FOR SHARE", (site.role,))
        woken.wait(10.0)
        database.execute("SELECT 1")

    async def run():
        token = await taken(site.claim("a"))
        stuck = LeaseDatabase(site.database._url, None, PATIENCE_S)
        stuck_call = asyncio.create_task(asyncio.to_thread(stuck._run, frozen))
        await asyncio.sleep(0.1)
        started_s = time.monotonic()
        b = site.claim("b")
        while True:
            with contextlib.suppress(LinkError):
                if await b.take():
                    break
            await asyncio.sleep(0.02)
        assert time.monotonic() - started_s < TTL_S + 2.0 * PATIENCE_S + 1.0
        assert b.tenure.token == token + 1
        woken.set()
        with pytest.raises(LinkError, match="idle-in-transaction"):
            await stuck_call
        stuck.close()

    asyncio.run(run())


def test_a_database_that_is_cut_off_is_given_up_in_time_and_used_again(postgres):
    async def run():
        async with CutLine("127.0.0.1", postgres.port) as line:
            database = LeaseDatabase(f"postgresql://wetwell@127.0.0.1:{line.port}/postgres", None, PATIENCE_S)
            one = lambda connection: connection.execute("SELECT 1").fetchall()  # noqa: E731
            assert await database.call(one) == [(1,)]
            line.cut()
            with pytest.raises(LinkError, match=r"no answer within 2 s"):
                await database.call(one)
            line.mend()
            assert await database.call(one) == [(1,)]
            database.close()

    asyncio.run(run())


def test_an_address_that_is_none_is_refused_without_showing_it():
    with pytest.raises(ConfigError, match=r"lease\.url: is no address") as refused:
        LeaseDatabase("postgresql://user:sesame@[host/name", None, 1.0)
    assert "sesame" not in str(refused.value)
