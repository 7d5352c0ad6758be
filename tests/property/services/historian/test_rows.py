"""A history is the same whether its samples come alone or in blocks, late or doubled, and when days become files."""

import contextlib
import itertools
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import psycopg
from hypothesis import given
from hypothesis import settings as limits
from hypothesis import strategies as st

from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.services.historian.rows import HOUR_NS, QUALITIES, pack_block
from wetwell.services.historian.samples import Samples, merged
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import DAY_NS, Batch, StationSpan, Store, blocks
from wetwell.services.historian.store.live.database import LiveDatabase
from wetwell.services.historian.store.live.file import LiveFile
from wetwell.services.historian.store.postgres_store import PostgresStore

NOW_NS = 10 * DAY_NS
TIME_NS = st.builds(
    lambda hour, ns: hour * HOUR_NS + ns, st.sampled_from([-1, 0, 24, 25, 48, 96]), st.integers(-6, 12)
)
"""Close to borders of hours and days, so that many samples share a row, and spans begin and end within one."""


class Act(NamedTuple):
    """Samples that are sent, alone or in a block, and what is done then."""

    places: list[int]
    in_block: bool
    then: str


PLACES = st.lists(st.integers(0, 29), min_size=1, max_size=15)
ACT = st.builds(
    Act,
    PLACES.map(sorted) | PLACES,
    st.sampled_from([True, True, False]),
    st.sampled_from(["", "commit", "maintain"]),
)
SPAN = st.tuples(TIME_NS, TIME_NS).map(lambda span: (min(span), max(span) + 1))


def sample_of(number: int, time_ns: int, pumps: int, grade: int) -> Sample:
    readings = tuple(PumpReading(flow_m3h=number + pump / 4, running=number % 3 == 0) for pump in range(pumps))
    level_m = None if number % 5 == 0 else number / 7
    seq = number % 3
    return Sample(station="alpha", seq=seq, time=time_ns, level_m=level_m, pumps=readings, quality=QUALITIES[grade])


@st.composite
def pools(draw: st.DrawFn) -> list[Sample]:
    """Samples in the order of time, each once by time and `seq`, of one or two qualities and numbers of pumps."""
    times_ns = sorted(draw(st.lists(TIME_NS, min_size=10, max_size=30)))
    kinds = draw(st.lists(st.tuples(st.integers(0, 2), st.integers(0, 2)), min_size=1, max_size=2))
    found = [sample_of(number, time_ns, *kinds[number % len(kinds)]) for number, time_ns in enumerate(times_ns)]
    return list({(sample.time, sample.seq): sample for sample in found}.values())


def chosen(pool: list[Sample], act: Act) -> list[Sample]:
    """Samples of an act that may share a block."""
    first, *others = [pool[place % len(pool)] for place in act.places]
    alike = [other for other in others if (other.quality, len(other.pumps)) == (first.quality, len(first.pumps))]
    return [first, *alike]


def played(store: Store, pool: list[Sample], acts: list[Act], *, blocks_too: bool) -> Historian:
    historian = Historian(store)
    sent = 0
    for act in acts:
        samples = chosen(pool, act)
        sent += len(samples)
        if act.in_block and blocks_too:
            historian.handle("blocks", SampleBlock.of(samples).encode())
        else:
            for sample in samples:
                historian.handle("samples", sample.encode())
        if act.then:
            historian.commit(0)
        if act.then == "maintain":
            historian.maintain(NOW_NS)
    historian.commit(0)
    figures = historian.figures(0)
    assert figures["taken"] == figures["committed"] == sent
    assert figures["malformed"] == figures["waiting"] == figures["lost"] == 0.0
    return historian


class Told(NamedTuple):
    """What a store says of a span."""

    days_ns: list[int]
    pumps: int | None
    samples: Samples
    is_few: bool
    is_less: bool


def told(store: Store, start_ns: int, end_ns: int) -> Told:
    samples = merged(list(blocks(store, "alpha", start_ns, end_ns)))
    return Told(
        days_ns=store.days_ns("alpha", start_ns, end_ns),
        pumps=store.pumps("alpha", start_ns, end_ns),
        samples=samples,
        is_few=store.is_few("alpha", start_ns, end_ns, len(samples)),
        is_less=store.is_few("alpha", start_ns, end_ns, len(samples) - 1),
    )


def all_told(
    store: Store, pool: list[Sample], acts: list[Act], spans: list[tuple[int, int]], *, blocks_too: bool
) -> tuple[list[Told], list[StationSpan], bytes]:
    """What a store that is written says of spans, before and after complete days are put away; and its hours."""
    historian = played(store, pool, acts, blocks_too=blocks_too)
    before = [told(store, *span) for span in spans]
    while historian.maintain(NOW_NS):
        pass
    after = [told(store, *span) for span in spans]
    return before + after, store.stations(), historian.answer("alpha", b'{"kind": "kpi"}')


def compare(make: Callable[[], Store], pool: list[Sample], acts: list[Act], spans: list[tuple[int, int]]) -> None:
    """A store that is written as a mixture says the same as one that is written as samples alone."""
    keys = [(sample.time, sample.seq) for act in acts for sample in chosen(pool, act)]
    is_once = len(set(keys)) == len(keys)
    spans = [*spans, (-2 * DAY_NS, 9 * DAY_NS)]
    with contextlib.closing(make()) as store:
        expected, stations, kpi = all_told(store, pool, acts, spans, blocks_too=False)
    with contextlib.closing(make()) as store:
        found, *others = all_told(store, pool, acts, spans, blocks_too=True)
    assert others == [stations, kpi]
    for mixed, alone in zip(found, expected, strict=True):
        assert (mixed.days_ns, mixed.pumps) == (alone.days_ns, alone.pumps)
        assert same(mixed.samples, alone.samples)
        assert (alone.is_less, mixed.is_less) == (False, False)
        assert (alone.is_few, mixed.is_few) == (True, True) or not is_once


def same(first: Samples, second: Samples) -> bool:
    pumps = max(first.pumps, second.pumps)
    return (
        np.array_equal(first.time_ns, second.time_ns)
        and np.array_equal(first.seq, second.seq)
        and np.array_equal(first.quality, second.quality)
        and np.array_equal(first.padded(pumps), second.padded(pumps), equal_nan=True)
    )


CASE = {"pool": pools(), "acts": st.lists(ACT, min_size=1, max_size=12), "spans": st.lists(SPAN, max_size=5)}


@limits(max_examples=15)
@given(**CASE)
def test_a_folder_gives_the_same_for_blocks_as_for_samples(
    pool: list[Sample], acts: list[Act], spans: list[tuple[int, int]]
) -> None:
    with tempfile.TemporaryDirectory() as name:
        folders = map(Path(name).joinpath, ("alone", "mixed"))
        compare(lambda: FolderStore(next(folders)), pool, acts, spans)


@limits(max_examples=6)
@given(**CASE)
def test_postgresql_gives_the_same_for_blocks_as_for_samples(
    postgres, pool: list[Sample], acts: list[Act], spans: list[tuple[int, int]]
) -> None:
    def empty() -> None:
        with psycopg.connect(postgres.url, autocommit=True) as database:
            database.execute("DROP SCHEMA IF EXISTS wetwell CASCADE")

    def make() -> Store:
        empty()
        return PostgresStore(postgres.url)

    try:
        compare(make, pool, acts, spans)
    finally:
        empty()


@limits(max_examples=40)
@given(pool=pools(), acts=st.lists(ACT, min_size=1, max_size=4))
def test_each_span_of_a_live_database_begins_and_ends_within_rows(pool: list[Sample], acts: list[Act]) -> None:
    sent = [chosen(pool, act) for act in acts]
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "live.sqlite"
        with contextlib.closing(LiveFile(path, contextlib.nullcontext)) as file:
            database = LiveDatabase(file)
            for samples in sent:
                database.write(Batch(samples=pack_block(SampleBlock.of(samples))))
            kept = {(sample.time, sample.seq): sample for samples in sent for sample in samples}
            is_once = len(kept) == sum(map(len, sent))
            times_ns = sorted({time_ns for time_ns, _ in kept})
            edges_ns = sorted({time_ns + later for time_ns in times_ns for later in (0, 1)})[:12]
            for start_ns in edges_ns:
                next_ns = next((time_ns for time_ns in times_ns if time_ns >= start_ns), None)
                assert database.next_time_ns("alpha", start_ns) == next_ns
            for start_ns, end_ns in itertools.combinations(edges_ns, 2):
                inside = sorted(key for key in kept if start_ns <= key[0] < end_ns)
                found = database.samples("alpha", start_ns, end_ns)
                assert list(zip(found.time_ns.tolist(), found.seq.tolist(), strict=True)) == inside
                assert (database.pumps("alpha", start_ns, end_ns) is None) == (not inside)
                count = database.count("alpha", start_ns, end_ns, 1000)
                assert count == len(inside) if is_once else count >= len(inside)
                assert database.count("alpha", start_ns, end_ns, 2) == min(count, 2)
