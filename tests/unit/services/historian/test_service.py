"""The historian: what it has committed it gives back, in every form that is asked for, and it bears what is odd."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from wetwell.protocols.messages.history import History, HistoryQuery
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import DAY_NS, Batch, StoreError

DAY = 20_000 * DAY_NS
NOW_NS = DAY + 100 * DAY_NS


def sample(
    time_s: float, seq: int = 0, station: str = "alpha", pumps: int = 1, level_m: float | None = 1.0
) -> Sample:
    pump = PumpReading(frequency_hz=50.0, flow_m3h=100.0, head_m=10.0, power_kw=5.0, running=True)
    return Sample(station=station, seq=seq, time=DAY + int(time_s * NS_PER_S), level_m=level_m, pumps=(pump,) * pumps)


def verdict(time_s: int, state: str = "normal") -> Verdict:
    return Verdict.model_validate(
        {
            "time": DAY + time_s * NS_PER_S,
            "station": "alpha",
            "pump": 1,
            "state": state,
            "probability": {state: 1.0},
            "evidence": {},
            "window": (0, 1),
        }
    )


@pytest.fixture
def store(tmp_path: Path) -> Iterator[FolderStore]:
    store = FolderStore(tmp_path / "history")
    yield store
    store.close()


@pytest.fixture
def historian(store: FolderStore) -> Historian:
    return Historian(store)


def fill(historian: Historian, *samples: Sample) -> int:
    for each in samples:
        historian.handle("samples", each.encode())
    return historian.commit(NOW_NS)


def ask(historian: Historian, station: str = "alpha", **query: object) -> History:
    payload = HistoryQuery.model_validate({"kind": "samples"} | query).encode()
    return History.decode(historian.answer(station, payload))


def test_samples_come_back_as_they_were_and_doubles_once(historian: Historian) -> None:
    late, first, odd = sample(5, 5), sample(1, 1, level_m=None), sample(2, 2).model_copy(update={"quality": "bad"})
    assert fill(historian, late, first, first, odd) == 4
    assert fill(historian, late) == 1
    answer = ask(historian, raw=True)
    assert answer.time == (first.time, odd.time, late.time)
    assert answer.columns["seq"] == (1.0, 2.0, 5.0)
    assert answer.columns["quality"] == (0.0, 2.0, 0.0)
    assert answer.columns["level_m"] == (None, 1.0, 1.0)
    assert answer.columns["pump1_running"] == (1.0, 1.0, 1.0)
    assert answer.columns["inflow_m3h"] == (None, None, None)
    assert not answer.more
    assert ask(historian, raw=True, points=2).more
    assert historian.figures(NOW_NS)["doubled"] == 2.0


def test_many_samples_come_as_means_with_least_and_largest(historian: Historian) -> None:
    fill(historian, *(sample(second, second, level_m=float(second)) for second in range(100)))
    answer = ask(historian, points=10)
    assert len(answer.time) == 10
    assert answer.columns["level_m"][0] == 4.5
    assert (answer.columns["level_m_min"][1], answer.columns["level_m_max"][1]) == (10.0, 19.0)
    assert answer.columns["inflow_m3h"] == (None,) * 10


def test_a_question_that_is_none_or_about_nobody_is_answered_with_an_error(historian: Historian) -> None:
    assert "kind" in History.decode(historian.answer("alpha", b'{"kind": "weather"}')).error
    assert (
        "end must lie after start"
        in History.decode(
            historian.answer(
                "alpha", b'{"kind": "samples", "start": "2025-01-01T00:00:00Z", "end": "2024-01-01T00:00:00Z"}'
            )
        ).error
    )
    assert ask(historian, "nobody").error == "station 'nobody' is not known"


@pytest.mark.parametrize(
    "payload",
    [b"", b"[]", sample(1, station="../alpha").encode(), sample(1, station="a" * 65).encode(), b'{"schema": "x"}'],
)
def test_what_is_no_sample_is_counted(historian: Historian, payload: bytes) -> None:
    historian.handle("samples", payload)
    assert historian.commit(NOW_NS) == 0
    assert historian.figures(NOW_NS)["malformed"] == 1.0


def test_verdicts_come_in_the_order_of_time_the_last_ones_and_doubles_once(historian: Historian) -> None:
    verdicts = [verdict(second, state) for second, state in ((2, "unknown"), (1, "normal"), (2, "normal"))]
    for each in (*verdicts, verdicts[0]):
        historian.handle("verdicts", each.encode())
    historian.commit(NOW_NS)
    told = ask(historian, kind="verdicts").messages
    assert [(message["time"][-3:], message["state"]) for message in told] == [
        ("01Z", "normal"),
        ("02Z", "unknown"),
        ("02Z", "normal"),
    ]
    assert ask(historian, kind="verdicts", points=1).messages == (json.loads(verdicts[2].encode()),)
    assert ask(historian).time == ()


def test_complete_days_become_files_and_nothing_that_is_asked_changes(
    historian: Historian, store: FolderStore
) -> None:
    times = [day * 86_400 + second for day in range(4) for second in range(0, 86_400, 120)]
    fill(historian, *(sample(second, number, level_m=number % 7) for number, second in enumerate(times)))
    questions = [{"points": 5_000}, {"points": 50}, {"raw": True, "points": 5_000}, {"kind": "kpi", "points": 5_000}]
    before = [ask(historian, **question) for question in questions]
    assert before[3].columns["pump1_energy_kwh"][:-1] == pytest.approx([5.0] * 95)
    while historian.maintain(NOW_NS):
        pass
    assert len(store.archive.days_ns("samples", "alpha")) == 2
    for question, answer in zip(questions, before, strict=True):
        after = ask(historian, **question)
        assert after.time == answer.time
        assert after.columns.keys() == answer.columns.keys()
        for name, column in answer.columns.items():
            assert np.allclose(np.array(after.columns[name], float), np.array(column, float), equal_nan=True), name
    assert [each["station"] for each in ask(historian, "_site", kind="stations").messages] == ["alpha"]


class Refusing:
    """A store that refuses until it is told to take."""

    def __init__(self) -> None:
        self.kept: list[Batch] = []
        self.refuses = True
        self.damages = 0

    def write(self, batch: Batch) -> int:
        if self.refuses:
            raise StoreError("disk full")
        self.kept.append(batch)
        return len(batch)

    def mend(self) -> None:
        pass

    def scrub(self) -> Iterator[None]:
        return iter(())

    def figures(self) -> dict[str, float]:
        raise StoreError("disk full")


def test_while_the_store_refuses_the_newest_wait_and_the_oldest_are_counted_as_lost() -> None:
    store = Refusing()
    historian = Historian(store, spool_rows=3)  # type: ignore[arg-type]
    for second in range(5):
        assert fill(historian, sample(second, second)) == 0
    assert historian.figures(NOW_NS)["waiting"] == 3.0
    assert historian.figures(NOW_NS)["lost"] == 2.0
    store.refuses = False
    assert historian.commit(NOW_NS) == 3
    assert [row.seq for batch in store.kept for row in batch.samples] == [2, 3, 4]
    assert historian.figures(NOW_NS)["is_failing"] == 0.0
