"""The gate: order, range and presence of values, before any statistic sees them."""

import math
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from wetwell.detector.nominal import Nominal
from wetwell.protocols.readings import PumpReadings, Readings
from wetwell.protocols.stamps import NS_PER_S

NAN = math.nan
MAX_GAP_S = 10.0
MAX_JUMP_S = 600.0
MIN_GAP_S = 0.05
"""Samples nearer to each other are taken for one that is doubled."""
MAX_LOST = 1_000_000
CONFIRMATIONS = 10
RESENT_SAMPLES = 1000
"""More samples than a bus sends again after a lost link; they come with numbers that were there before."""
LEVEL_RANGE_M = (-1.0, 100.0)
POWER_RANGE_KW = (-1.0, 1.0e6)

Range = tuple[float, float]


class PumpFrame(NamedTuple):
    """What is known of one pump in one second; NaN is "no value", None is "not said"."""

    frequency_hz: float
    flow_m3h: float
    head_m: float
    power_kw: float
    running: bool | None


class Frame(NamedTuple):
    """A sample that has passed the gate.

    `gap_s` is the time since the one before: 0 for the first, infinite where nobody knows, after a clock step.
    """

    time_ns: int
    gap_s: float
    level_m: float
    inflow_m3h: float
    pumps: tuple[PumpFrame, ...]


class Gate:
    """Lets samples through in the order of their time, with values that can be.

    A value that is absent, NaN or outside its range becomes NaN and is counted. A sample that is doubled or late is
    dropped and counted. A sample that jumps more than `MAX_JUMP_S` ahead ("future"), and samples that are behind, may
    come from a source whose clock was set: after `CONFIRMATIONS` such samples in a row that agree with one another,
    the gate follows them and counts a clock step. Where their numbers are old too they are most likely sent again
    after a lost link, and it takes more than `RESENT_SAMPLES` of them: then the source has begun anew.

    `samples` = frames + `doubled` + `late` + `future` - `clock_steps`. `lost` counts the numbers that `seq` has
    passed over; a sample that comes late after all is counted there too.

    Memory: constant.
    """

    def __init__(self, nominal: Nominal) -> None:
        self._last_ns: int | None = None
        self._other_ns: int | None = None
        self._other_count = 0
        self._last_seq: int | None = None
        self._ranges: list[tuple[Range, Range, Range]] = [
            (
                (-0.5, 2.0 * nominal.frequencies_hz[pump]),
                (-0.1 * nominal.runout_flow_m3h(pump), 2.0 * nominal.runout_flow_m3h(pump)),
                (-10.0, 3.0 * nominal.curves[pump][0]),
            )
            for pump in range(nominal.pumps)
        ]
        self.counts: Counter[str] = Counter()

    @property
    def last_ns(self) -> int | None:
        """Time of the last sample that was let through."""
        return self._last_ns

    def update(self, sample: Readings) -> Frame | None:
        """Frame of a sample, or None where it is dropped."""
        self.counts["samples"] += 1
        gap_s = self._gap_s(sample.time, sample.seq)
        self._count_lost(sample.seq, is_dropped=gap_s is None)
        if gap_s is None:
            return None
        if gap_s > MAX_GAP_S:
            self.counts["gaps"] += 1
        if sample.quality == "bad":
            self.counts["bad_quality"] += 1
            return Frame(sample.time, gap_s, NAN, NAN, tuple(_NOTHING for _ in self._ranges))
        if len(sample.pumps) != len(self._ranges):
            self.counts["wrong_pump_count"] += 1
        return Frame(
            sample.time,
            gap_s,
            self._checked(sample.level_m, LEVEL_RANGE_M),
            NAN if sample.inflow_m3h is None or not math.isfinite(sample.inflow_m3h) else sample.inflow_m3h,
            self._pump_frames(sample.pumps),
        )

    def _pump_frames(self, readings: Sequence[PumpReadings]) -> tuple[PumpFrame, ...]:
        frames = []
        for reading, (frequency_range, flow_range, head_range) in zip(readings, self._ranges, strict=False):
            frequency_hz, flow_m3h = reading.frequency_hz, reading.flow_m3h
            head_m, power_kw = reading.head_m, reading.power_kw
            if frequency_hz is None or not frequency_range[0] <= frequency_hz <= frequency_range[1]:
                frequency_hz = self._refused(frequency_hz)
            if flow_m3h is None or not flow_range[0] <= flow_m3h <= flow_range[1]:
                flow_m3h = self._refused(flow_m3h)
            if head_m is None or not head_range[0] <= head_m <= head_range[1]:
                head_m = self._refused(head_m)
            if power_kw is None or not POWER_RANGE_KW[0] <= power_kw <= POWER_RANGE_KW[1]:
                power_kw = self._refused(power_kw)
            frames.append(PumpFrame(frequency_hz, flow_m3h, head_m, power_kw, reading.running))
        frames += [_NOTHING] * (len(self._ranges) - len(frames))
        return tuple(frames)

    def _checked(self, value: float | None, limits: Range) -> float:
        return value if value is not None and limits[0] <= value <= limits[1] else self._refused(value)

    def _refused(self, value: float | None) -> float:
        """Count a value that is absent or cannot be; it becomes NaN."""
        is_missing = value is None or not math.isfinite(value)
        self.counts["missing_values" if is_missing else "out_of_range_values"] += 1
        return NAN

    def _count_lost(self, seq: int, *, is_dropped: bool) -> None:
        if self._last_seq is None:
            self._last_seq = seq
            return
        if self._last_seq + 1 < seq <= self._last_seq + MAX_LOST:  # beyond, the source counts from elsewhere
            self.counts["lost"] += seq - self._last_seq - 1
        if seq > self._last_seq or not is_dropped:
            self._last_seq = seq

    def _gap_s(self, time_ns: int, seq: int) -> float | None:
        """Seconds since the last sample let through; None if this one is to be dropped."""
        if self._last_ns is None:
            self._last_ns = time_ns
            return 0.0
        gap_s = (time_ns - self._last_ns) / NS_PER_S
        if MIN_GAP_S <= gap_s <= MAX_JUMP_S:
            self._last_ns = time_ns
            self._other_ns, self._other_count = None, 0
            return gap_s
        if 0.0 <= gap_s < MIN_GAP_S:
            self.counts["doubled"] += 1
            return None
        self.counts["late" if gap_s < 0.0 else "future"] += 1
        follows = self._other_ns is not None and 0.0 < (time_ns - self._other_ns) / NS_PER_S <= MAX_JUMP_S
        self._other_count = self._other_count + 1 if follows else 1
        self._other_ns = time_ns
        is_new = self._last_seq is None or seq > self._last_seq
        if self._other_count < (CONFIRMATIONS if is_new else RESENT_SAMPLES):
            return None
        self.counts["clock_steps"] += 1
        self._last_ns = time_ns
        self._other_ns, self._other_count = None, 0
        return math.inf


_NOTHING = PumpFrame(NAN, NAN, NAN, NAN, None)
