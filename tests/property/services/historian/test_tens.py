"""Ten minutes that are kept beside each day: a long span is answered from them as from the samples."""

import contextlib
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.historian.answers import spans_of
from wetwell.services.historian.rows import HOUR_NS
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import DAY_NS
from wetwell.services.historian.summary import TEN_NS, Summary

NOW_NS = 30 * DAY_NS
SECONDS = st.integers(0, 5 * 86_400 - 1)


def kept(historian: Historian, seconds: list[int], seed: int) -> None:
    """Keep samples of one or two pumps, some without values, and do what is due."""
    rng = np.random.default_rng(seed)
    for second in seconds:
        level_m, flow_m3h = rng.uniform(0.0, 9.0, 2)
        pumps = (PumpReading(flow_m3h=flow_m3h if second % 3 else None),) * (1 + second % 2)
        made = Sample(station="a", seq=second, time=second * NS_PER_S, level_m=level_m, pumps=pumps)
        historian.handle("samples", made.encode())
    historian.commit(NOW_NS)
    while historian.maintain(NOW_NS):
        pass
    assert "failed_maintenance" not in historian.figures(NOW_NS)


def same(first: Summary, second: Summary) -> bool:
    return np.array_equal(first.time_ns, second.time_ns) and all(
        np.allclose(getattr(first, name), getattr(second, name), rtol=1e-12, equal_nan=True)
        for name in ("count", "mean", "low", "high")
    )


@settings(max_examples=15)
@given(
    early=st.lists(SECONDS, min_size=30, max_size=60, unique=True),
    late=st.lists(SECONDS, max_size=20, unique=True),
    minutes_after=st.none() | st.integers(1, 3),
    tens=st.tuples(st.integers(-10, 800), st.integers(1, 800), st.integers(6, 300)),
)
def test_a_long_span_is_answered_from_ten_minutes_as_from_samples(early, late, minutes_after, tens) -> None:
    start_ns, end_ns = tens[0] * TEN_NS, (tens[0] + tens[1]) * TEN_NS
    span_ns = tens[2] * TEN_NS
    with (
        tempfile.TemporaryDirectory() as name,
        contextlib.closing(FolderStore(Path(name), downsample_after_days=minutes_after)) as store,
    ):
        historian = Historian(store)
        kept(historian, early, seed=1)
        kept(historian, sorted(set(late) - set(early)), seed=2)
        filed = {*store.archive.days_ns("samples", "a"), *store.archive.days_ns("minutes", "a")}
        assert set(store.archive.days_ns("tens", "a")) == filed, "each file has its ten minutes"
        quick = store.summary("a", start_ns, end_ns, span_ns)
        shutil.rmtree(Path(name) / "tens", ignore_errors=True)
        assert same(quick, store.summary("a", start_ns, end_ns, span_ns))


@given(
    start_ns=st.integers(-(10**18), 10**18), length_ns=st.integers(1, 400 * DAY_NS), points=st.integers(1, 100_000)
)
def test_spans_hold_what_was_asked_for_and_are_no_more(start_ns, length_ns, points) -> None:
    end_ns = start_ns + length_ns
    first_ns, last_ns, span_ns = spans_of(start_ns, end_ns, points)
    assert span_ns > 0
    assert -(-(last_ns - first_ns) // span_ns) <= points
    assert 0 <= first_ns - start_ns < TEN_NS
    assert 0 <= last_ns - end_ns < TEN_NS
    if length_ns >= points * HOUR_NS:
        assert first_ns % TEN_NS == last_ns % TEN_NS == span_ns % TEN_NS == 0


def test_ten_minutes_that_are_missing_or_damaged_are_made_anew(tmp_path) -> None:
    with contextlib.closing(FolderStore(tmp_path)) as store:
        historian = Historian(store)
        kept(historian, list(range(0, 5 * 86_400, 400)), seed=3)
        whole = store.summary("a", 0, 5 * DAY_NS, TEN_NS)
        first, second, *_ = days_ns = store.archive.days_ns("tens", "a")
        store.archive.delete("tens", "a", first)  # as a history of an earlier version
        damaged = store.archive.path("tens", "a", second)
        damaged.write_bytes(damaged.read_bytes()[:-200])
        assert same(store.summary("a", 0, 5 * DAY_NS, TEN_NS), whole)
        assert [str(damaged) in told for told in store.archive.damage()] == [True]
        list(store.scrub())
        assert store.archive.days_ns("tens", "a") == days_ns[2:]
        while historian.maintain(NOW_NS):
            pass
        assert store.archive.days_ns("tens", "a") == days_ns
        assert store.archive.damage() == []
        assert same(store.summary("a", 0, 5 * DAY_NS, TEN_NS), whole)


def test_a_day_that_cannot_be_summed_up_is_put_aside_and_holds_nothing_up(tmp_path) -> None:
    with contextlib.closing(FolderStore(tmp_path)) as store:
        historian = Historian(store)
        kept(historian, list(range(0, 5 * 86_400, 400)), seed=3)
        first, second, *_ = store.archive.days_ns("tens", "a")
        for day_ns in (first, second):
            store.archive.delete("tens", "a", day_ns)
        path = store.archive.path("samples", "a", first)
        path.write_bytes(path.read_bytes()[:-200])
    with contextlib.closing(FolderStore(tmp_path)) as store:
        historian = Historian(store)
        while historian.maintain(NOW_NS):
            pass
        assert "failed_maintenance" not in historian.figures(NOW_NS)
        assert path.with_name(f"{path.name}.refused").exists()
        assert second in store.archive.days_ns("tens", "a")


LOOK = """
import sys
from pathlib import Path
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import DAY_NS
store = FolderStore(Path(sys.argv[1]))
assert len(store.summary("a", 0, 5 * DAY_NS, DAY_NS)) == 5
assert len(store.archive.samples("a", store.archive.days_ns("samples", "a")[0]))
print("pandas" in sys.modules)
"""


def test_reading_daily_files_does_not_load_pandas(tmp_path) -> None:
    with contextlib.closing(FolderStore(tmp_path)) as store:
        kept(Historian(store), list(range(0, 5 * 86_400, 400)), seed=3)
    command = [sys.executable, "-c", LOOK, str(tmp_path)]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "False\n"
