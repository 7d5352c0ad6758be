"""Both stores of the historian, a folder and PostgreSQL, keep and give back the same."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import psycopg
import pytest

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.messages.history import History, HistoryQuery
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.timestamps import NS_PER_S, to_iso
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import DAY_NS, Batch, Store, StoreError
from wetwell.services.historian.store.postgres_store import PostgresStore

DAY = 20_000 * DAY_NS
NOW_NS = DAY + 100 * DAY_NS
QUESTIONS = [
    {"kind": "samples", "points": 10_000},
    {"kind": "samples", "points": 40},
    {"kind": "samples", "raw": True, "points": 10_000},
    {"kind": "samples", "raw": True, "start": DAY + 5 * NS_PER_S, "end": DAY + DAY_NS + 1, "points": 500},
    {"kind": "kpi", "points": 10_000},
    {"kind": "kpi", "points": 3},
    {"kind": "verdicts"},
    {"kind": "changes"},
    {"kind": "stations"},
]


@pytest.fixture
def make_store(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Callable[..., Store]]:
    """Maker of empty stores, by name."""
    stores: list[Store] = []

    def make(name: str, **limits: int) -> Store:
        if name == "folder":
            stores.append(FolderStore(tmp_path / f"history-{len(stores)}", **limits))
        else:
            server = request.getfixturevalue("postgres")
            with psycopg.connect(server.url, autocommit=True) as database:
                database.execute("DROP SCHEMA IF EXISTS wetwell CASCADE")
            stores.append(PostgresStore(server.url, **limits))
        return stores[-1]

    yield make
    for store in stores:
        store.close()


def samples(days: int) -> list[Sample]:
    rng = np.random.default_rng(7)
    made = []
    seconds = [second + twin for second in range(0, days * 86_400, 1200) for twin in (0, 20)]
    for seq, second in enumerate(seconds):
        level_m, flow_m3h, power_kw = rng.uniform(0.1, 9.0, 3)
        pump = PumpReading(flow_m3h=flow_m3h, power_kw=power_kw, running=seq % 3 > 0)
        level = None if seq % 11 == 0 else level_m
        pumps = (pump,) * (1 + (second > 86_400))
        made.append(Sample(station="alpha", seq=seq, time=DAY + second * NS_PER_S, level_m=level, pumps=pumps))
    return made


def verdict(day: int) -> Verdict:
    return Verdict.model_validate(
        {
            "time": DAY + day * DAY_NS,
            "station": "alpha",
            "pump": 1,
            "state": "normal",
            "probability": {"normal": 1.0},
            "evidence": {"reason": 'quotes " and µ and \\u0000 there'},
            "window": (0, 1),
        }
    )


def filled(store: Store, days: int = 4) -> Historian:
    historian = Historian(store)
    made = samples(days)
    for sample in (*made[::-1], *made[:5]):
        historian.handle("samples", sample.encode())
    for day in range(days):
        historian.handle("verdicts", verdict(day).encode())
        historian.handle("verdicts", verdict(day).encode())
    assert historian.commit(NOW_NS) == len(made) + 5 + 2 * days + 1  # the first verdict is a change
    assert historian.figures(NOW_NS)["doubled"] == 5.0 + days
    return historian


def ask(historian: Historian, **query: object) -> History:
    return History.decode(historian.answer("alpha", HistoryQuery.model_validate(query).encode()))


def maintain(historian: Historian) -> None:
    while historian.maintain(NOW_NS):
        pass
    assert "failed_maintenance" not in historian.figures(NOW_NS)


def close(first: History, second: History) -> bool:
    """Whether two answers say the same; a column that is absent, of a pump that came later, has no values."""
    nothing = (None,) * len(first.time)
    pairs = [
        (np.array(first.columns.get(name, nothing), float), np.array(second.columns.get(name, nothing), float))
        for name in {*first.columns, *second.columns}
    ]
    return (first.time, first.messages, first.more, first.error) == (
        second.time,
        second.messages,
        second.more,
        "",
    ) and all(np.allclose(one, other, equal_nan=True) for one, other in pairs)


@pytest.mark.parametrize("name", ["folder", "postgres"])
def test_answers_stay_the_same_through_maintenance(name: str, make_store: Callable[..., Store]) -> None:
    historian = filled(make_store(name))
    before = [ask(historian, **question) for question in QUESTIONS]
    assert len(before[0].time) == len(samples(4))
    assert [message["evidence"] for message in before[6].messages][:1] == [verdict(0).evidence]
    maintain(historian)
    for question, answer in zip(QUESTIONS, before, strict=True):
        assert close(ask(historian, **question), answer), question


def test_both_stores_answer_alike(make_store: Callable[..., Store]) -> None:
    folder, postgres = filled(make_store("folder")), filled(make_store("postgres"))
    for question in QUESTIONS:
        assert close(ask(folder, **question), ask(postgres, **question)), question


@pytest.mark.parametrize("name", ["folder", "postgres"])
def test_old_days_become_minutes_and_older_ones_go_while_figures_stay(
    name: str, make_store: Callable[..., Store]
) -> None:
    historian = filled(make_store(name, downsample_after_days=2, keep_days=4), days=6)
    kpi, mean = ask(historian, kind="kpi", points=10_000), ask(historian, kind="samples", points=6)
    maintain(historian)
    assert close(ask(historian, kind="kpi", points=10_000), kpi)
    kept = ask(historian, kind="samples", points=6)
    assert kept.time == mean.time[1:]
    for column in ("level_m", "level_m_min", "level_m_max", "pump1_flow_m3h"):
        assert kept.columns[column] == pytest.approx(mean.columns[column][1:])
    assert ask(historian, kind="samples", raw=True).time[0] == DAY + 3 * DAY_NS
    told = ask(historian, kind="verdicts").messages
    assert [message["time"] for message in told] == [verdict(day).model_dump()["time"] for day in range(1, 6)]
    assert len(ask(historian, kind="changes", start=DAY + 4 * DAY_NS).messages) == 1, "what stands is known for ever"


@pytest.mark.parametrize("name", ["folder", "postgres"])
def test_a_stamp_far_in_the_future_does_not_move_the_end_of_the_history(
    name: str, make_store: Callable[..., Store]
) -> None:
    """Neither what "the last 12 h" are, nor which days are complete."""
    store = make_store(name)
    historian = Historian(store)

    def handle(times_ns: list[int]) -> None:
        for seq, time_ns in enumerate(times_ns):
            historian.handle("samples", Sample(station="a", seq=seq, time=time_ns, level_m=1.0, pumps=()).encode())
        historian.commit(NOW_NS)

    def told() -> str:
        answer = History.decode(historian.answer("_site", HistoryQuery(kind="stations").encode()))
        return str(answer.messages[0]["last"])

    seconds = [DAY + second * NS_PER_S for second in range(20)]
    ahead_ns = DAY + 40 * DAY_NS
    handle([ahead_ns, *seconds[:5]])
    assert told() == to_iso(seconds[4]), "even if it comes first"
    handle(seconds[5:])
    assert told() == to_iso(seconds[-1])
    while historian.maintain(NOW_NS):
        pass
    assert len(store.samples("a", DAY, DAY + DAY_NS)) == len(seconds)
    if isinstance(store, FolderStore):
        assert store.live.next_time_ns("a", DAY) == DAY, "today is no complete day"
    assert len(store.samples("a", ahead_ns, ahead_ns + 1)) == 1, "it is kept all the same"
    handle([ahead_ns + second * NS_PER_S for second in range(1, 10)])
    assert told() == to_iso(ahead_ns + 9 * NS_PER_S), "ten that agree are followed"


@pytest.mark.parametrize("name", ["folder", "postgres"])
def test_late_samples_join_their_day_and_its_figures(name: str, make_store: Callable[..., Store]) -> None:
    made = samples(4)
    store = make_store(name)
    historian = Historian(store)
    for sample in made[: len(made) // 8] + made[len(made) // 4 :]:
        historian.handle("samples", sample.encode())
    historian.commit(NOW_NS)
    maintain(historian)
    for sample in made:
        historian.handle("samples", sample.encode())
    historian.commit(NOW_NS)
    maintain(historian)
    whole = filled(make_store("folder"))
    for question in QUESTIONS[:6]:
        assert close(ask(historian, **question), ask(whole, **question)), question


@pytest.mark.parametrize("name", ["folder", "postgres"])
def test_late_samples_do_not_hide_the_minutes_of_their_day(name: str, make_store: Callable[..., Store]) -> None:
    historian = filled(make_store(name, downsample_after_days=2))
    mean = ask(historian, kind="samples", points=24)
    maintain(historian)
    for done in (False, True):
        assert close(ask(historian, kind="samples", points=24), mean), done
        historian.handle("samples", samples(1)[3].encode())
        assert historian.commit(NOW_NS) == 1
        assert close(ask(historian, kind="samples", points=24), mean), done
        maintain(historian)


def test_ten_minutes_answer_for_long_spans_also_of_an_earlier_version(make_store, postgres) -> None:
    store = make_store("postgres")
    historian = filled(store, days=6)
    maintain(historian)
    mean = ask(historian, kind="samples", points=40)
    with psycopg.connect(postgres.url, autocommit=True) as database:
        (kept,) = database.execute("SELECT count(*) FROM wetwell.ten").fetchone() or ()
        assert kept == 4 * 72, "days before the live one and its last; samples come each 20 minutes"
        store.close()
        database.execute("DROP TABLE wetwell.ten")
        later = PostgresStore(postgres.url)
        again = Historian(later)
        assert close(ask(again, kind="samples", points=40), mean), "from the samples"
        maintain(again)
        database.execute("DELETE FROM wetwell.sample WHERE time_ns < %s", (DAY + 4 * DAY_NS,))
        assert close(ask(again, kind="samples", points=40), mean)
    later.close()


def test_an_address_that_is_none_and_a_second_historian_are_refused(
    make_store: Callable[..., Store], postgres
) -> None:
    with pytest.raises(ConfigError, match=r"historian\.url: is no address of PostgreSQL") as told:
        PostgresStore("postgresql://user:sesame@[host/name")
    assert "sesame" not in str(told.value)
    make_store("postgres").write(Batch())
    second = PostgresStore(postgres.url)
    with pytest.raises(StoreError, match="another historian works here"):
        second.write(Batch())
    second.close()
