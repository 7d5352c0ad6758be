"""The gate: what it marks, drops, counts and follows."""

import math
from collections import Counter
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.stream.block import LiveBlock
from wetwell.detector.stream.gate import (
    CONFIRMATIONS,
    RESENT_SAMPLES,
    gate_counts,
    gate_ranges,
    let_through,
    new_gate,
)
from wetwell.detector.stream.sampling_steps import NEWEST, USUAL, new_sampling_steps
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.quantities import FIRST_PUMP, PUMP_VALUES
from wetwell.protocols.timestamps import MAX_STAMP_NS, NS_PER_S

START_S = 1_700_000_000
HOUR_S = 3600
GOOD = PumpReading(frequency_hz=50.0, flow_m3h=200.0, head_m=26.0, power_kw=15.0, running=True)


def sample(second, *, seq=None, level_m=1.0, pumps=(GOOD,) * 3, quality="good"):
    return Sample(
        station="alpha",
        seq=second if seq is None else seq,
        time=(START_S + second) * NS_PER_S,
        level_m=level_m,
        pumps=pumps,
        quality=quality,
    )


class PumpFrame(NamedTuple):
    """What is known of one pump in one second; NaN is "no value", None is "not said"."""

    frequency_hz: float
    flow_m3h: float
    head_m: float
    power_kw: float
    running: bool | None


class Frame(NamedTuple):
    """A sample that has passed the gate."""

    time_ns: int
    gap_s: float
    level_m: float
    pumps: tuple[PumpFrame, ...]


class Gate:
    """The compiled gate, a sample at a time."""

    def __init__(self, datasheet):
        self.state, self.steps, self.ranges = new_gate(), new_sampling_steps(), gate_ranges(datasheet)
        self.values = np.full(FIRST_PUMP + PUMP_VALUES * datasheet.pumps, math.nan)
        self.live = LiveBlock(datasheet.pumps)

    @property
    def counts(self):
        return Counter(gate_counts(self.state))

    def update(self, sent):
        """Frame of a sample, or None where it is dropped."""
        block = self.live.fill(sent)
        told = block.time_ns[0], block.seq[0], block.values[0], block.pumps, block.is_bad, block.is_confirmed[0]
        if not let_through(self.state[0], self.steps, self.ranges, *told, self.values):
            return None
        pumps = (
            PumpFrame(*readings, None if math.isnan(running) else running > 0.0)
            for *readings, running in self.values[FIRST_PUMP:].reshape(-1, PUMP_VALUES).tolist()
        )
        return Frame(int(block.time_ns[0]), float(self.state["gap_s"][0]), float(self.values[0]), tuple(pumps))


@pytest.fixture
def gate(alpha):
    return Gate(datasheet_of(alpha))


def test_a_good_sample_passes_unchanged(gate):
    frame = gate.update(sample(0))
    assert (frame.time_ns, frame.gap_s, frame.level_m) == (START_S * NS_PER_S, 0.0, 1.0)
    assert frame.pumps == ((50.0, 200.0, 26.0, 15.0, True),) * 3
    assert gate.counts == {"samples": 1}


@pytest.mark.parametrize("value", [None, math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", ["frequency_hz", "flow_m3h", "head_m", "power_kw"])
def test_a_value_that_is_none_becomes_nan_and_is_missing(gate, name, value):
    bad = GOOD.model_copy(update={name: value})
    frame = gate.update(sample(0, pumps=(GOOD, bad, GOOD)))
    assert math.isnan(getattr(frame.pumps[1], name))
    assert frame.pumps[0] == frame.pumps[2] == GOOD_FRAME
    assert gate.counts == {"samples": 1, "missing_values": 1}


GOOD_FRAME = (50.0, 200.0, 26.0, 15.0, True)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("frequency_hz", -1.0),
        ("frequency_hz", 101.0),
        ("flow_m3h", 1000.0),
        ("flow_m3h", -100.0),
        ("head_m", 109.0),
        ("head_m", -11.0),
        ("power_kw", -2.0),
    ],
)
def test_a_value_that_cannot_be_becomes_nan_and_is_out_of_range(gate, name, value):
    frame = gate.update(sample(0, pumps=(GOOD.model_copy(update={name: value}), GOOD, GOOD)))
    assert math.isnan(getattr(frame.pumps[0], name))
    assert gate.counts == {"samples": 1, "out_of_range_values": 1}


def test_the_level_is_checked_too(gate):
    assert math.isnan(gate.update(sample(0, level_m=1e6)).level_m)
    assert math.isnan(gate.update(sample(1, level_m=None)).level_m)
    assert gate.counts == {"samples": 2, "out_of_range_values": 1, "missing_values": 1}


def test_doubled_late_and_future_samples_are_dropped_and_counted(gate):
    arrived = [0, 1, 1, 3, 2, 4, 4 + 2 * HOUR_S, 5]
    frames = [gate.update(sample(second)) for second in arrived]
    assert [frame is not None for frame in frames] == [True, True, False, True, False, True, False, True]
    assert {name: gate.counts[name] for name in ("doubled", "late", "future", "clock_steps")} == {
        "doubled": 1,
        "late": 1,
        "future": 1,
        "clock_steps": 0,
    }


@pytest.mark.parametrize("step_s", [HOUR_S, -HOUR_S])
@pytest.mark.parametrize("period_s", [1, 60])
def test_a_clock_that_was_set_is_followed_after_the_confirmations(gate, step_s, period_s):
    for n in range(20):
        gate.update(sample(n * period_s, seq=n))
    frames = [gate.update(sample((20 + n) * period_s + step_s, seq=20 + n)) for n in range(20)]
    assert [frame is None for frame in frames] == [True] * (CONFIRMATIONS - 1) + [False] * (21 - CONFIRMATIONS)
    assert frames[CONFIRMATIONS - 1].gap_s == math.inf
    assert frames[CONFIRMATIONS].gap_s == period_s
    assert gate.counts["clock_steps"] == 1
    assert gate.counts["future" if step_s > 0 else "late"] == CONFIRMATIONS
    assert gate.counts["lost"] == 0


def test_old_samples_that_a_bus_sends_again_are_dropped_however_many(gate):
    for second in range(2000):
        gate.update(sample(second))
    assert [gate.update(sample(second)) for second in range(1400, 2000)] == [None] * 600
    assert gate.update(sample(2000)).gap_s == 1.0
    assert gate.counts == {"samples": 2601, "late": 599, "doubled": 1}


@pytest.mark.parametrize("is_ahead", [False, True])
def test_samples_that_a_bus_sends_again_teach_no_step(gate, is_ahead):
    """Neither one of their own, if only some of them come, nor that from the last of them to the next new one."""
    period_s = 300
    for k in range(20):
        gate.update(sample(k * period_s, seq=k))
    usual_s = gate.steps[USUAL]
    for k in (*range(0, 16, 3), *((20, 21) if is_ahead else ())):
        gate.update(sample(k * period_s, seq=k))
    assert gate.steps[USUAL] == usual_s == period_s
    assert gate.steps[NEWEST:].max() == period_s


def test_a_source_that_begins_anew_with_an_old_clock_is_followed_in_the_end(gate):
    for second in range(3000, 3010):
        gate.update(sample(second))
    frames = [gate.update(sample(second)) for second in range(RESENT_SAMPLES)]
    assert frames[:-1] == [None] * (RESENT_SAMPLES - 1)
    assert frames[-1].gap_s == math.inf
    assert gate.counts["clock_steps"] == 1


@pytest.mark.parametrize("period_s", [1, 60])
def test_a_source_that_begins_anew_after_a_long_silence_is_followed_after_the_confirmations(gate, period_s):
    for n in range(2_000):
        gate.update(sample(n * period_s, seq=n))
    frames = [gate.update(sample((2_000 + n) * period_s + HOUR_S, seq=n)) for n in range(20)]
    assert [frame is None for frame in frames] == [True] * (CONFIRMATIONS - 1) + [False] * (21 - CONFIRMATIONS)


def test_a_double_does_not_put_off_that_a_clock_that_was_set_is_followed(gate):
    for n in range(20):
        gate.update(sample(n, seq=n))
    frames = [gate.update(sample(20 + n // 2 + HOUR_S, seq=20 + n // 2)) for n in range(2 * CONFIRMATIONS)]
    assert [frame is not None for frame in frames] == [False] * (2 * CONFIRMATIONS - 2) + [True, False]
    assert gate.counts["doubled"] == CONFIRMATIONS


def test_wild_stamps_among_good_ones_are_never_followed(gate):
    for n in range(5 * CONFIRMATIONS):
        assert gate.update(sample(n, seq=2 * n)) is not None
        assert gate.update(sample(n + HOUR_S, seq=2 * n + 1)) is None
    assert gate.counts["future"] == 5 * CONFIRMATIONS
    assert gate.counts["clock_steps"] == gate.counts["lost"] == 0


def test_wild_stamps_that_disagree_are_not_followed(gate):
    gate.update(sample(0))
    for n in range(5 * CONFIRMATIONS):
        assert gate.update(sample((2 + n % 2) * HOUR_S * 24 - n)) is None
    assert gate.counts["clock_steps"] == 0


def test_a_gap_is_told_and_counted(gate):
    gate.update(sample(0))
    gate.update(sample(1))
    assert gate.update(sample(11)).gap_s == 10.0
    assert gate.counts["gaps"] == 0
    assert gate.update(sample(22)).gap_s == 11.0
    assert gate.counts["gaps"] == 1


@pytest.mark.parametrize("period_s", [10, 60, 300, 900])
def test_a_slow_feed_has_gaps_where_it_lacks_samples(gate, period_s):
    seconds = [n * period_s for n in (*range(10), 13, *range(14, 20))]
    assert None not in [gate.update(sample(second)) for second in seconds]
    assert gate.counts == {"samples": len(seconds), "gaps": 1, "lost": gate.counts["lost"]}


@pytest.mark.parametrize("period_s", [60, 900])
def test_what_a_slow_feed_calls_the_future_is_some_steps_away(gate, period_s):
    for n in range(10):
        gate.update(sample(n * period_s, seq=n))
    assert gate.update(sample(21 * period_s, seq=10)) is None
    assert gate.counts["future"] == 1
    assert gate.update(sample(10 * period_s, seq=11)) is not None


@pytest.mark.parametrize("period_s", [60, 900])
def test_a_clock_of_a_slow_feed_that_was_set_is_followed(gate, period_s):
    for n in range(10):
        gate.update(sample(n * period_s, seq=n))
    later = [gate.update(sample((10 + n) * period_s + 240 * HOUR_S, seq=10 + n)) for n in range(CONFIRMATIONS)]
    assert [frame is None for frame in later] == [True] * (CONFIRMATIONS - 1) + [False]


def test_a_feed_that_becomes_slow_is_followed(gate):
    for second in range(100):
        gate.update(sample(second))
    frames = [gate.update(sample(100 + 900 * n)) for n in range(1, 9)]
    assert [frame is None for frame in frames] == [True, True, True, *[False] * 5]


def test_lost_samples_are_counted_by_seq_and_a_restart_is_no_loss(gate):
    for second, seq in enumerate([7, 8, 12, 0, 1, 3]):
        gate.update(sample(second, seq=seq))
    assert gate.counts["lost"] == 3 + 1


def test_a_sample_that_is_dropped_has_still_arrived(gate):
    for second, seq in [(0, 0), (1, 1), (90_000, 2), (3, 3), (3, 3), (2, 2), (4, 4)]:
        gate.update(sample(second, seq=seq))
    assert gate.counts["lost"] == 0


@pytest.mark.parametrize("pumps", [0, 2, 5])
def test_a_wrong_number_of_pumps_is_counted_and_filled_or_cut(gate, pumps):
    frame = gate.update(sample(0, pumps=(GOOD,) * pumps))
    assert len(frame.pumps) == 3
    assert [pump == GOOD_FRAME for pump in frame.pumps] == [n < pumps for n in range(3)]
    assert gate.counts == {"samples": 1, "wrong_pump_count": 1}


def test_a_sample_of_bad_quality_keeps_its_place_in_time_but_no_values(gate):
    frame = gate.update(sample(0, quality="bad"))
    assert math.isnan(frame.level_m)
    assert all(math.isnan(pump.flow_m3h) and pump.running is None for pump in frame.pumps)
    assert gate.counts == {"samples": 1, "bad_quality": 1}
    assert not math.isnan(gate.update(sample(1, quality="uncertain")).level_m)


anything = st.none() | st.floats()
readings = st.builds(
    PumpReading,
    frequency_hz=anything,
    flow_m3h=anything,
    head_m=anything,
    power_kw=anything,
    running=st.none() | st.booleans(),
)
stamps = st.integers(0, 60).map(lambda s: (START_S + s) * NS_PER_S) | st.integers(-MAX_STAMP_NS, MAX_STAMP_NS)
runs_of_stamps = st.builds(
    lambda first, length, step: [min(first + n * step * NS_PER_S, MAX_STAMP_NS) for n in range(length)],
    stamps,
    st.integers(1, 15),
    st.integers(-2, 15),
).filter(lambda run: min(run) >= -MAX_STAMP_NS)
wild_samples = st.builds(
    Sample,
    station=st.just("alpha"),
    seq=st.integers(0, 2**40),
    time=stamps,
    level_m=anything,
    pumps=st.lists(readings, max_size=4).map(tuple),
    quality=st.sampled_from(["good", "uncertain", "bad"]),
)


@given(st.lists(runs_of_stamps, max_size=12), st.lists(wild_samples, min_size=1, max_size=12))
def test_whatever_arrives_time_rises_but_at_counted_steps_and_the_counts_add_up(alpha, runs, wild):
    gate = Gate(datasheet_of(alpha))
    arriving = [
        wild[n % len(wild)].model_copy(update={"time": stamp})
        for n, stamp in enumerate(s for run in runs for s in run)
    ]
    frames, steps = [], 0
    for sent in arriving + wild:
        frame = gate.update(sent)
        if frame is not None:
            if gate.counts["clock_steps"] > steps:
                assert frame.gap_s == math.inf
            elif frames:
                assert frame.time_ns > frames[-1].time_ns
                assert frame.gap_s == (frame.time_ns - frames[-1].time_ns) / NS_PER_S
            assert len(frame.pumps) == 3
            assert not any(math.isinf(value) for pump in frame.pumps for value in pump[:4])
            frames.append(frame)
        steps = gate.counts["clock_steps"]
    counts = gate.counts
    assert counts["samples"] == len(arriving) + len(wild)
    assert (
        counts["samples"]
        == len(frames) + counts["doubled"] + counts["late"] + counts["future"] - counts["clock_steps"]
    )
