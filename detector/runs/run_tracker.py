"""From the samples of a station to its pump runs: hands blocks to the compiled loop, and runs on where it stops."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.runs.run import Run, Segments
from wetwell.detector.statistics.curve_drift import CurveFTests
from wetwell.detector.statistics.robust import median
from wetwell.detector.statistics.rolling_f_test import RollingFTest
from wetwell.detector.stream.block import Block
from wetwell.detector.stream.loop import Stop, process_samples
from wetwell.detector.stream.missing_signals import new_missing_signals
from wetwell.detector.stream.run_state import LACKED_FLOW_ALONE, SIGNALS, count_steady, drop_ended
from wetwell.detector.stream.sampling_steps import USUAL
from wetwell.detector.stream.state import new_state
from wetwell.detector.stream.steady_samples import (
    LEAST_ROOM,
    SEGMENT_S,
    SEGMENT_SAMPLES,
    new_steady_samples,
    segment_averages,
)
from wetwell.detector.stream.stuck_sensors import stuck_names
from wetwell.protocols.arrays import Records
from wetwell.protocols.jit import SameTypes
from wetwell.protocols.quantities import FIRST_PUMP, FLOW, FREQUENCY, HEAD, PUMP_VALUES
from wetwell.protocols.timestamps import NS_PER_S

ROLLING_SAMPLES = 300

_DONE = Stop.SAMPLES_DONE.value  # asked of the enumeration, it takes a tenth of a sample
_process_samples = SameTypes(process_samples)


class RunTracker:
    """Cuts the samples of a station into pump runs.

    A sample is steady `WARM_UP_S` after its pump has started and after any other pump has started or stopped, and
    `SETTLING_S` after the last change of its speed. A run ends when the pump stops, when the stream breaks for more
    than `BREAK_S` and its own period explain, or in parts of `MAX_RUN_S` (of a slow feed `MAX_RUN_STEPS`), so that
    one that never stops is judged too.

    Memory: 80 bytes a steady sample of the open runs, at most `MAX_RUN_S` of each.
    """

    def __init__(self, datasheet: Datasheet) -> None:
        self._datasheet = datasheet
        self._rolling = RollingFTest(ROLLING_SAMPLES, datasheet.pumps)
        self.state = new_state(datasheet, self._rolling)

    def stops(self, block: Block) -> Iterator[int]:
        """Yield each `Stop` at which there is something to judge in a block `in_one_piece`; it goes on from there."""
        row, stop = self._process(0, _DONE, block)
        while stop != _DONE:
            if stop == Stop.ROOM_FULL:
                room = np.concatenate((self.state.steady_samples, new_steady_samples()))
                self.state = self.state._replace(steady_samples=room)
            else:
                yield stop
            row, stop = self._process(row, stop, block)

    @property
    def now_ns(self) -> int:
        """Time of the last sample that was let through; 0 before the first."""
        return int(self.state.gate["time_ns"][0])

    @property
    def seen_s(self) -> float:
        """Time that the station has been seen."""
        return float(self.state.gate["seen_s"][0])

    def ended_runs(self) -> list[Run]:
        """Runs that end with the last sample; what was kept of them is dropped."""
        return self._take_ended(self.now_ns)

    def finish(self) -> list[Run]:
        """Runs that are still open, at the end of a recording."""
        self.state.pumps["is_ending"] = self.state.pumps["is_open"]
        self.state.pumps["is_open"] = 0
        return self._take_ended(0)

    def newly_blind_runs(self) -> list[Run]:
        """Open runs that have lacked a needed signal since their start, `BLIND_S` ago; each is given once."""
        blind = np.flatnonzero(self.state.pumps["is_blind"]).tolist()
        return [self._handed_over(pump, self._steady_of(pump)) for pump in blind]

    def gathered_pumps(self) -> list[int]:
        """Pumps that lack signals, and have just filled a segment of what is left."""
        gathered: list[int] = np.flatnonzero(self.state.missing_signals["is_full"]).tolist()
        return gathered

    def full_pumps(self) -> list[int]:
        """Pumps that have just filled a segment."""
        pumps, each = self.state.pumps, self._segment_samples
        steady = zip(pumps["is_steady"].tolist(), pumps["samples"].tolist(), strict=True)
        return [pump for pump, (is_steady, samples) in enumerate(steady) if is_steady and samples % each == 0]

    def last_segments(self, pump: int, segments: int) -> Run:
        """The last segments of an open run, or all if it has fewer; the window begins with them."""
        if not self.state.pumps["is_open"][pump]:
            raise ValueError(f"pump {pump} has no open run")
        samples = int(self.state.pumps["samples"][pump])
        return self._open_run(pump, self._steady_of(pump), max(samples - segments * self._segment_samples, 0))

    def last_segment(self, pump: int) -> Segments:
        """The last segment of an open run."""
        steady = self._steady_samples()
        last = (steady["pump"] == pump).nonzero()[0][-self._segment_samples :]
        return self._segments(pump, steady.take(last))

    def missing_now(self, pump: int) -> list[str]:
        """Needed signals that the last sample lacks of a pump."""
        reading = self.state.frame[FIRST_PUMP + PUMP_VALUES * pump :]
        needed = {"flow_m3h": FLOW, "frequency_hz": FREQUENCY, "head_m": HEAD}
        return [name for name, at in needed.items() if math.isnan(reading[at])]

    def rolling_tests(self, pump: int) -> CurveFTests | None:
        """Both F-tests over the last steady samples; None while there are too few."""
        return self._rolling.value(pump)

    def strongest_log_p(self, pump: int) -> dict[str, float]:
        """Least log p of the rolling tests of both curves since this was asked last."""
        own = self.state.pumps[pump]
        strongest = {"pump": float(own["pump_log_p"]), "system": float(own["system_log_p"])}
        own["pump_log_p"] = own["system_log_p"] = 0.0
        return strongest

    def set_learning(self, pump: int, *, is_learning: bool) -> None:
        """Say whether a pump is being learnt: then there are no looks at its open runs."""
        self.state.pumps["is_learning"][pump] = is_learning

    def set_lacking_head(self, pump: int, *, lacks_head: bool) -> None:
        """Say whether a pump is judged without a head sensor, from its next sample on."""
        self.state.lacks_head[pump] = lacks_head

    def begin_anew(self, pump: int, *, is_learning: bool) -> None:
        """Forget what the open run has shown under another baseline."""
        self.set_learning(pump, is_learning=is_learning)
        self.state.pumps["stuck"][pump] = 0
        self.state.missing_signals[pump] = new_missing_signals(1)[0]

    def restore(self, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
        """Go on from what `StreamState.remembered` gave; what is not there is as before the first sample."""
        arrays = RunTracker(self._datasheet).state.remembered() | dict(arrays)
        self.state = self.state._replace(steady_samples=np.empty_like(arrays["steady_samples"]))
        for name, array in self.state.remembered().items():
            array[...] = arrays[name]

    def _process(self, row: int, stop: int, block: Block) -> tuple[int, int]:
        arrays: tuple[Any, ...] = self.state  # handed over one by one: as one value they take twice as long
        return _process_samples(row, stop, *block, *arrays)

    @property
    def _segment_samples(self) -> int:
        return int(self.state.sampling_period["segment_samples"][0])

    @property
    def _step_s(self) -> float:
        return float(self.state.sampling_steps[USUAL])

    def _take_ended(self, time_ns: int) -> list[Run]:
        pumps = self.state.pumps
        ended = [self._finished(pump) for pump in np.flatnonzero(pumps["is_ending"]).tolist()]
        drop_ended(pumps, self.state.steady_samples, time_ns)
        needed = LEAST_ROOM * (1 + count_steady(pumps) // LEAST_ROOM)
        if needed < len(self.state.steady_samples):
            self.state = self.state._replace(steady_samples=self.state.steady_samples[:needed].copy())
        return ended

    def _handed_over(self, pump: int, steady: Records) -> Run:
        """The open run with its drawdown, which is told once, as are the readings that were stuck."""
        own = self.state.pumps[pump]
        run = self._open_run(pump, steady, log_ratio=float(own["log_ratio"]))
        own["log_ratio"], own["stuck"] = math.nan, 0
        return run

    def _finished(self, pump: int) -> Run:
        """The whole open run; its period says how many samples a segment has from now on."""
        steady = self._steady_of(pump)
        time_s = steady["time_s"]
        period_s = float(median(time_s[1:] - time_s[:-1])) if len(time_s) > 1 else self._step_s
        if period_s > 0.0:
            samples = min(SEGMENT_SAMPLES, max(1, round(SEGMENT_S / period_s)))
            self.state.sampling_period["segment_samples"] = samples
        return self._handed_over(pump, steady)

    def _open_run(self, pump: int, steady: Records, first: int = 0, *, log_ratio: float = math.nan) -> Run:
        """The open run from a steady sample on; where that is not the first, its window begins there."""
        own, steady = self.state.pumps[pump], steady[first:]
        part_ns, seen, time_s = int(own["part_ns"]), int(own["seen"]), steady["time_s"]
        return Run(
            pump=pump,
            window_ns=(part_ns + round(time_s[0] * NS_PER_S) if first else part_ns, int(own["last_ns"])),
            time_s=time_s,
            flow_m3h=steady["flow_m3h"],
            head_m=steady["head_m"],
            speed_ratio=steady["speed_ratio"],
            total_flow_m3h=steady["total_m3h"],
            level_m=steady["level_m"],
            power_kw=steady["power_kw"],
            segments=self._segments(pump, steady),
            missing=frozenset(name for bit, name in enumerate(SIGNALS) if not seen >> bit & 1),
            stuck=stuck_names(pump, int(own["stuck"])),
            log_ratio=log_ratio,
            run_s=float(own["run_s"]),
            seen_s=float(self.state.gate["seen_s"][0]),
            running=int(self.state.missing_signals["running"][pump]),
            step_s=self._step_s,
            lacks_head=bool(self.state.lacks_head[pump]),
            lacked_flow_alone=bool(seen >> LACKED_FLOW_ALONE & 1),
        )

    def _steady_samples(self) -> Records:
        """Those of all open runs."""
        return self.state.steady_samples[: count_steady(self.state.pumps)]

    def _steady_of(self, pump: int) -> Records:
        steady = self._steady_samples()
        own: Records = steady.compress(steady["pump"] == pump)  # a third of the time of indexing with a mask
        return own

    def _segments(self, pump: int, steady: Records) -> Segments:
        samples = self._segment_samples
        residual_m, means = segment_averages(self.state.table[pump], steady, samples)
        return Segments(residual_m=residual_m, samples=samples, **means)
