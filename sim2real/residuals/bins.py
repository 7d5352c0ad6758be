"""Where residuals are taken: means over short bins, one signal, pump, regime and cycle each."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from typing import Literal, get_args

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.sim2real.recording.regimes import REGIMES
from wetwell.sim2real.recording.seconds import since_changes

Signal = Literal["flow", "head", "power", "level", "start_level", "stop_level", "telemetry"]
SIGNALS: tuple[Signal, ...] = get_args(Signal)
FLOW, HEAD, POWER, LEVEL, START_LEVEL, STOP_LEVEL, TELEMETRY = range(7)
NO_PUMP = -1
MIN_BINS = 12
"""Bins without which a cell, a signal in a regime, says nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bins:
    """What each residual speaks of and what it weighs; (bins,) arrays.

    Attributes
    ----------
    signal, regime, cycle, pump, second : arrays
        Indices into `SIGNALS` and `REGIMES`; cycle as in `Regimes`; pump from 0 or `NO_PUMP`; middle of the bin.
    deviation : array
        Standard deviation of the bin's mean, in the unit of its signal: noise and what a right model may be off.
    floor : array
        Mean square that noise alone makes of the residual, at most 1.
    tolerance : array
        Error of a right model that does not average out, such as of a curve or of a scan, in units of `deviation`.
    material : array
        Size under which nobody acts on a difference, in units of `deviation`.
    """

    signal: Integers
    regime: Integers
    cycle: Integers
    pump: Integers
    second: Integers
    deviation: Floats
    floor: Floats
    tolerance: Floats
    material: Floats

    @property
    def size(self) -> int:
        """Number of bins."""
        return self.signal.size

    def cells(self, rows: Flags, signals: Iterable[int] = range(len(SIGNALS))) -> Iterator[tuple[int, int, Flags]]:
        """Signal, regime and rows of each cell in which enough of these rows lie."""
        for signal in signals:
            for regime in range(len(REGIMES)):
                cell = rows & (self.signal == signal) & (self.regime == regime)
                if cell.sum() >= MIN_BINS:
                    yield signal, regime, cell


def allowed_size(material: Floats, floor: Floats) -> Floats:
    """Size under which a difference is none: what is material, and what a right model may be off; as of `Bins`."""
    return np.asarray(np.hypot(material, np.sqrt(np.maximum(1.0 - floor, 0.0))), dtype=np.float64)


def joined(parts: list[Bins]) -> Bins:
    """Bins one after the other."""
    return Bins(
        **{field.name: np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Bins)}
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Seconds:
    """Seconds that count, in order, where each bin begins among them, and how many are in it."""

    second: Integers
    begin: Integers
    counts: Floats

    def means(self, values: Floats) -> Floats:
        """(bins,) means of (n,) values, all seconds of a recording."""
        return self.means_of(values[self.second])

    def means_of(self, values: Floats) -> Floats:
        """(bins,) means of values of the seconds that count."""
        return np.asarray(np.add.reduceat(values, self.begin) / self.counts, dtype=np.float64)

    def middle(self, values: Integers) -> Integers:
        """(bins,) value of (n,) ones, all seconds of a recording, in the middle of each bin."""
        return np.asarray(values[self.second[self.begin + (self.counts.astype(np.int64) - 1) // 2]])

    def bins(
        self,
        signal: int,
        pump: int,
        regime: Integers,
        cycle: Integers,
        *,
        deviation: Floats,
        floor: Floats,
        tolerance: Floats,
        material: Floats,
    ) -> Bins:
        """Bins of one signal of one pump, or of the station; regime and cycle are those of (n,) seconds."""
        return Bins(
            signal=np.full(self.counts.size, signal),
            regime=self.middle(regime),
            cycle=self.middle(cycle),
            pump=np.full(self.counts.size, pump),
            second=self.middle(np.arange(regime.size)),
            deviation=deviation,
            floor=floor,
            tolerance=tolerance,
            material=material,
        )


def binned(counted: Flags, key: Integers, length_s: Integers) -> Seconds:
    """Bins of consecutive seconds with one key, each at most `length_s` long.

    Parameters
    ----------
    counted : (n,) array
        Seconds that count.
    key : (n,) array
        A change of it begins a new bin.
    length_s : (n,) array
        [s]
    """
    number = np.cumsum(since_changes(key) % length_s == 0)
    second = np.flatnonzero(counted)
    _, begin, counts = np.unique(number[second], return_index=True, return_counts=True)
    return Seconds(second=second, begin=begin, counts=counts.astype(np.float64))
