"""The gate: order, range and presence of values, before any statistic sees them."""

import math
from collections import Counter
from dataclasses import dataclass

from wetwell.detector.nominal import Nominal
from wetwell.protocols.messages import Sample
from wetwell.protocols.stamps import NS_PER_S

NAN = math.nan
MAX_GAP_S = 10.0
MAX_JUMP_S = 600.0
CONFIRMATIONS = 10
LEVEL_RANGE_M = (-1.0, 100.0)


@dataclass(frozen=True, slots=True)
class PumpFrame:
    """What is known of one pump in one second; NaN is "no value", None is "not said"."""

    frequency_hz: float
    flow_m3h: float
    head_m: float
    power_kw: float
    running: bool | None


@dataclass(frozen=True, slots=True)
class Frame:
    """A sample that has passed the gate. `gap_s` is the time since the one before, 0 for the first."""

    time_ns: int
    gap_s: float
    level_m: float
    pumps: tuple[PumpFrame, ...]


class Gate:
    """Lets samples through in the order of their time, with values that can be.

    A value that is absent, NaN or outside its range becomes NaN and is counted. A sample that is doubled or late is
    dropped and counted. A sample that jumps more than `MAX_JUMP_S` ahead ("future"), and samples that are behind, may
    come from a source whose clock was set: after `CONFIRMATIONS` such samples in a row that agree with one another,
    the gate follows them and counts a clock step.

    Memory: constant.
    """

    def __init__(self, nominal: Nominal) -> None:
        self._last_ns: int | None = None
        self._other_ns: int | None = None
        self._other_count = 0
        self._last_seq: int | None = None
        self._ranges = [
            {
                "frequency_hz": (-0.5, 2.0 * nominal.frequencies_hz[pump]),
                "flow_m3h": (-0.1 * nominal.runout_flow_m3h(pump), 2.0 * nominal.runout_flow_m3h(pump)),
                "head_m": (-10.0, 3.0 * nominal.curves[pump][0]),
                "power_kw": (-1.0, math.inf),
            }
            for pump in range(nominal.pumps)
        ]
        self.counts: Counter[str] = Counter()

    def update(self, sample: Sample) -> Frame | None:
        """Frame of a sample, or None where it is dropped."""
        self.counts["samples"] += 1
        gap_s = self._gap_s(sample.time)
        if gap_s is None:
            return None
        self._count_lost(sample.seq)
        if gap_s > MAX_GAP_S:
            self.counts["gaps"] += 1
        if sample.quality == "bad":
            self.counts["bad_quality"] += 1
            return Frame(sample.time, gap_s, NAN, tuple(_NOTHING for _ in self._ranges))
        if len(sample.pumps) != len(self._ranges):
            self.counts["wrong_pump_count"] += 1
        return Frame(
            sample.time,
            gap_s,
            self._checked(sample.level_m, LEVEL_RANGE_M),
            tuple(
                self._pump(sample, pump, ranges) if pump < len(sample.pumps) else _NOTHING
                for pump, ranges in enumerate(self._ranges)
            ),
        )

    def _pump(self, sample: Sample, pump: int, ranges: dict[str, tuple[float, float]]) -> PumpFrame:
        reading = sample.pumps[pump]
        return PumpFrame(
            self._checked(reading.frequency_hz, ranges["frequency_hz"]),
            self._checked(reading.flow_m3h, ranges["flow_m3h"]),
            self._checked(reading.head_m, ranges["head_m"]),
            self._checked(reading.power_kw, ranges["power_kw"]),
            reading.running,
        )

    def _checked(self, value: float | None, limits: tuple[float, float]) -> float:
        if value is None or not math.isfinite(value):
            self.counts["missing_values"] += 1
            return NAN
        if not limits[0] <= value <= limits[1]:
            self.counts["out_of_range_values"] += 1
            return NAN
        return value

    def _count_lost(self, seq: int) -> None:
        if self._last_seq is not None and seq > self._last_seq + 1:
            self.counts["lost"] += seq - self._last_seq - 1
        self._last_seq = seq

    def _gap_s(self, time_ns: int) -> float | None:
        """Seconds since the last sample let through; None if this one is to be dropped."""
        if self._last_ns is None:
            self._last_ns = time_ns
            return 0.0
        gap_s = (time_ns - self._last_ns) / NS_PER_S
        if 0.0 < gap_s <= MAX_JUMP_S:
            self._last_ns = time_ns
            self._other_ns, self._other_count = None, 0
            return gap_s
        if gap_s == 0.0:
            self.counts["doubled"] += 1
            return None
        self.counts["late" if gap_s < 0.0 else "future"] += 1
        follows = self._other_ns is not None and 0.0 < (time_ns - self._other_ns) / NS_PER_S <= MAX_GAP_S
        self._other_count = self._other_count + 1 if follows else 1
        self._other_ns = time_ns
        if self._other_count < CONFIRMATIONS:
            return None
        self.counts["clock_steps"] += 1
        self._last_ns = time_ns
        self._other_ns, self._other_count = None, 0
        return math.inf


_NOTHING = PumpFrame(NAN, NAN, NAN, NAN, None)
