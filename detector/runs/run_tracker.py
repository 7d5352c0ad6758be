"""Cuts the samples of a station into pump runs."""

import numpy as np

from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.runs.run import SEGMENT_S, SEGMENT_SAMPLES, SIGNALS, Run, Segments
from wetwell.detector.statistics.robust import median
from wetwell.detector.stream.gate import Frame
from wetwell.detector.stream.run_state import (
    COLUMNS,
    LEAST_ROOM,
    SEGMENT_MEANS,
    average,
    collect,
    drop_ended,
    new_pace,
    new_pumps,
    note_gap,
    note_running,
    steady_rows,
)
from wetwell.protocols.arrays import Floats
from wetwell.protocols.timestamps import NS_PER_S


class RunTracker:
    """Cuts the frames of a station into pump runs.

    A sample is steady `WARM_UP_S` after its pump has started and after any other pump has started or stopped, and
    `SETTLING_S` after the last change of its speed. A run ends when the pump stops, when the stream breaks for more
    than `BREAK_S` and its own pace explain, or in parts of `MAX_RUN_S`, so that one that never stops is judged too.

    Memory: 80 bytes a steady sample of the open runs, at most `MAX_RUN_S` of each.
    """

    def __init__(self, datasheet: Datasheet) -> None:
        self._datasheet = datasheet
        self.table = datasheet.table()
        self.pumps = new_pumps(datasheet)
        self.pace = new_pace()
        self.rows = np.zeros((LEAST_ROOM, COLUMNS))

    def update(self, frame: Frame) -> list[Run]:
        """Runs that this frame ends."""
        values = np.array(frame.values())
        is_ending = note_running(self.table, self.pumps, self.pace[0], frame.time_ns, frame.gap_s, values)
        note_gap(self.pace[0], frame.gap_s)
        ended = self.take_ended(frame.time_ns) if is_ending else []
        if self.is_full:
            self.make_room()
        collect(self.table, self.pumps, frame.time_ns, values, self.rows)
        return ended

    @property
    def is_full(self) -> bool:
        """Whether another sample of each pump may not find room."""
        return steady_rows(self.pumps) + len(self.pumps) > len(self.rows)

    def make_room(self) -> None:
        """Make room for some more steady samples."""
        self.rows = np.concatenate((self.rows, np.zeros((LEAST_ROOM, COLUMNS))))

    def take_ended(self, time_ns: int) -> list[Run]:
        """Runs that end with the frame of this stamp; what was kept of them is dropped."""
        ended = [self._finished(pump) for pump in np.flatnonzero(self.pumps["is_ending"]).tolist()]
        drop_ended(self.pumps, self.rows, time_ns)
        needed = LEAST_ROOM * (1 + steady_rows(self.pumps) // LEAST_ROOM)
        if needed < len(self.rows):
            self.rows = self.rows[:needed].copy()
        return ended

    def finish(self) -> list[Run]:
        """Runs that are still open, at the end of a recording."""
        self.pumps["is_ending"] = self.pumps["is_open"]
        self.pumps["is_open"] = 0
        return self.take_ended(0)

    def newly_blind_runs(self) -> list[Run]:
        """Open runs that have lacked a needed signal since their start, `BLIND_S` ago; each is given once."""
        return [self._as_run(pump) for pump in np.flatnonzero(self.pumps["is_blind"]).tolist()]

    def full_pumps(self) -> list[int]:
        """Pumps that have just filled a segment."""
        return [pump for pump in range(len(self.pumps)) if self.full_segments(pump)]

    def full_segments(self, pump: int) -> int:
        """Number of segments of an open run, when it has just filled one; else 0."""
        state = self.pumps[pump]
        if not state["is_steady"] or state["samples"] % self._segment_samples:
            return 0
        return int(state["samples"]) // self._segment_samples

    def last_segments(self, pump: int, segments: int) -> Run:
        """The last segments of an open run, of which the window begins with them."""
        if not self.pumps["is_open"][pump]:
            raise ValueError(f"pump {pump} has no open run")
        return self._as_run(pump, int(self.pumps["samples"][pump]) - segments * self._segment_samples)

    def last_segment(self, pump: int) -> Segments:
        """The last segment of an open run."""
        return self._segments(pump, self._rows_of(pump)[-self._segment_samples :])

    @property
    def _segment_samples(self) -> int:
        return int(self.pace["segment_samples"][0])

    def _rows_of(self, pump: int) -> Floats:
        rows = self.rows[: steady_rows(self.pumps)]
        own: Floats = rows[rows[:, 0] == pump]
        return own

    def _segments(self, pump: int, rows: Floats) -> Segments:
        samples = self._segment_samples
        means = np.empty((SEGMENT_MEANS, len(rows) // samples))
        average(self.table, pump, rows, samples, means)
        flow_m3h, total_m3h, duty_m3h, duty_total_m3h, level_m, speed_ratio = means[2:]
        return Segments(
            residual_m=np.ascontiguousarray(means[:2].T),
            flow_m3h=flow_m3h,
            total_m3h=total_m3h,
            duty_m3h=duty_m3h,
            duty_total_m3h=duty_total_m3h,
            level_m=level_m,
            speed_ratio=speed_ratio,
            samples=samples,
        )

    def _finished(self, pump: int) -> Run:
        """The whole open run; its pace says how many samples a segment has from now on."""
        time_s = self._rows_of(pump)[:, 1]
        if len(time_s) > 1:
            period_s = float(median(np.diff(time_s)))
            self.pace["segment_samples"] = min(SEGMENT_SAMPLES, max(1, round(SEGMENT_S / period_s)))
        return self._as_run(pump)

    def _as_run(self, pump: int, first_row: int = 0) -> Run:
        """The open run from a row on; where that is not the first, its window begins there."""
        state, rows = self.pumps[pump], self._rows_of(pump)[first_row:]
        part_ns, seen = int(state["part_ns"]), int(state["seen"])
        time_s = rows[:, 1]
        return Run(
            pump=pump,
            window_ns=(part_ns + round(time_s[0] * NS_PER_S) if first_row else part_ns, int(state["last_ns"])),
            time_s=time_s,
            flow_m3h=rows[:, 2],
            head_m=rows[:, 3],
            speed_ratio=rows[:, 4],
            total_flow_m3h=rows[:, 5],
            level_m=rows[:, 6],
            power_kw=rows[:, 7],
            segments=self._segments(pump, rows),
            missing=frozenset(name for bit, name in enumerate(SIGNALS) if not seen >> bit & 1),
        )
