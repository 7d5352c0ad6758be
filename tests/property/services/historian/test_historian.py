"""Whatever comes in whatever order, crashes between: what was committed is read back exactly, and once."""

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as limits
from hypothesis import strategies as st

from wetwell.protocols.messages.history import LONGEST_NS, History
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.quantities import columns_of
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import DAY_NS, blocks
from wetwell.services.historian.summary import Summary

NUMBER = st.none() | st.floats(allow_nan=False, allow_infinity=False)
READING = st.builds(PumpReading, frequency_hz=NUMBER, flow_m3h=NUMBER, running=st.none() | st.booleans())
SAMPLE = st.builds(
    Sample,
    station=st.sampled_from(["alpha", "beta"]),
    seq=st.integers(0, 3) | st.integers(0, 2**63 - 1),
    time=st.builds(
        lambda day, ns: day * DAY_NS + ns, st.integers(-2, 5), st.integers(0, 3) | st.integers(0, DAY_NS - 1)
    ),
    level_m=NUMBER,
    pumps=st.lists(READING, max_size=3).map(tuple),
    quality=st.sampled_from(["good", "uncertain", "bad"]),
)
ACT = SAMPLE | st.sampled_from(["commit", "maintain", "crash"])


def values_of(sample: Sample, pumps: int) -> list[float]:
    values: list[float | None] = [sample.level_m, sample.inflow_m3h]
    for pump in sample.pumps:
        values += (pump.frequency_hz, pump.flow_m3h, pump.head_m, pump.power_kw, pump.running)
    values += [None] * (len(columns_of(pumps)) - len(values))
    return [np.nan if value is None else float(value) for value in values]


@limits(max_examples=30)
@given(acts=st.lists(ACT, max_size=40))
def test_what_was_committed_is_read_back_exactly(acts: list[Sample | str]) -> None:
    with tempfile.TemporaryDirectory() as name:
        store = FolderStore(Path(name))
        historian = Historian(store)
        waiting: list[Sample] = []
        kept: dict[tuple[str, int, int], Sample] = {}
        for act in [*acts, "commit", "maintain"]:
            if isinstance(act, Sample):
                historian.handle("samples", act.encode())
                waiting.append(act)
            elif act == "commit":
                assert historian.commit(0) == len(waiting)
                for sample in waiting:
                    kept.setdefault((sample.station, sample.time, sample.seq), sample)
                waiting = []
            elif act == "maintain":
                historian.maintain(10 * DAY_NS)
            else:
                store.close()
                store = FolderStore(Path(name))
                historian, waiting = Historian(store), []
        for station in ("alpha", "beta"):
            expected = [kept[key] for key in sorted(kept) if key[0] == station]
            found = list(blocks(store, station, -3 * DAY_NS, 9 * DAY_NS))
            keys = [key for block in found for key in zip(block.time_ns.tolist(), block.seq.tolist(), strict=True)]
            assert keys == [(sample.time, sample.seq) for sample in expected]
            rows = [
                (row, int(grade), block.pumps)
                for block in found
                for row, grade in zip(block.values, block.quality, strict=True)
            ]
            for sample, (row, grade, pumps) in zip(expected, rows, strict=True):
                assert np.array_equal(row, values_of(sample, pumps), equal_nan=True)
                assert ("good", "uncertain", "bad")[grade] == sample.quality
        store.close()


VALUES = st.lists(st.lists(st.just(np.nan) | st.floats(-1e6, 1e6), min_size=7, max_size=7), min_size=1, max_size=60)


@given(values=VALUES, first=st.integers(1, 7), second=st.integers(1, 5))
def test_summing_up_twice_is_summing_up_once(values: list[list[float]], first: int, second: int) -> None:
    table = np.array(values)
    ones = Summary(
        time_ns=np.arange(len(table)) - 20,
        count=(~np.isnan(table)).astype(float),
        mean=table,
        low=table,
        high=table,
    )
    twice, once = ones.over(-20, first).over(-20, first * second), ones.over(-20, first * second)
    assert np.array_equal(twice.time_ns, once.time_ns)
    assert np.array_equal(twice.count, once.count)
    assert np.allclose(twice.mean, once.mean, rtol=1e-9, atol=1e-6, equal_nan=True)
    assert np.array_equal(twice.low, once.low, equal_nan=True)
    assert np.array_equal(twice.high, once.high, equal_nan=True)


WORDS = st.sampled_from(["samples", "kpi", "verdicts", "stations", "2025-01-01T00:00:00Z", "-1", "", "alpha"])
VALUE = st.none() | st.booleans() | st.integers() | st.floats() | WORDS
NAMES = ["schema", "kind", "start", "end", "points", "raw", "station", "time", "seq", "pumps", "level_m", "quality"]
NEARLY = st.dictionaries(st.sampled_from(NAMES), VALUE | st.lists(VALUE, max_size=2)).map(
    lambda told: json.dumps(told).encode()
)


@limits(max_examples=300)
@given(payload=st.binary(max_size=200) | NEARLY)
def test_no_payload_takes_it_down(filled: Historian, payload: bytes) -> None:
    for kind in ("samples", "blocks", "verdicts", "alarms"):
        filled.handle(kind, payload)
    assert History.decode(filled.answer("alpha", payload)).station


@pytest.fixture(scope="module")
def filled() -> Iterator[Historian]:
    """A historian that knows a station with samples at the ends of time."""
    with tempfile.TemporaryDirectory() as name:
        store = FolderStore(Path(name))
        historian = Historian(store)
        for time in (-LONGEST_NS, 0, 1, LONGEST_NS):
            historian.handle("samples", Sample(station="alpha", seq=0, time=time, pumps=()).encode())
        assert historian.commit(0) == 4
        yield historian
        store.close()
