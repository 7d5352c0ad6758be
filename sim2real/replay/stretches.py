"""The level before each start and stop of a pump, along straight lines."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.drives import MOVED_HZ
from wetwell.sim2real.recording.regimes import START_RAMP, Event, Regimes
from wetwell.sim2real.recording.traces import BETWEEN, Traces
from wetwell.sim2real.replay.observer import hides_cycles

WINDOW_S, MIN_LEVELS = 30, 8
"""How long before an event values tell of the level, and how many a line takes at the least."""
ROWS_BEFORE, FEWEST_ROWS = 4, 2
"""The same in rows, where they lie apart: so few that the inflow stands."""
NEVER_S = 10**6
"""Since the event before the first one."""
MOST_OF_THEM = 0.5
"""Share of the starts, or of the stops, that have a line, from which they count where rows lie apart.

Of runs that are hardly longer than a row only those have one whose rows came at certain times: their moments are no
even ones.
"""


@dataclass(frozen=True, kw_only=True)
class Stretches:
    """Straight stretches of the level before each event, to be read at other times than they were recorded.

    Attributes
    ----------
    second : (events,) array
        Of each event, the last before it. [s]
    counted, is_counted : (events, values) arrays
        Seconds of the values before each, and which of them count.
    level_m : (n,) array
        NaN is "no value". [m]
    least : int
        How many values a line takes.
    late_s : float
        By which they are recorded late. [s]
    """

    second: Integers
    counted: Integers
    is_counted: Flags
    level_m: Floats
    least: int = MIN_LEVELS
    late_s: float = 0.0

    def lines(self, shift_s: float = 0.0) -> tuple[Floats, Floats]:
        """(events,) level and slope at each event for a level that was recorded `shift_s` late. [m, m/s].

        Where too few values are left the line of the unshifted stretch is gone on with.
        """
        if shift_s == 0.0:
            return self._unshifted[:2]
        whole = int(np.floor(shift_s))
        share = shift_s - whole
        near = self._fitted(whole)[:2]
        far = self._fitted(whole + 1)[:2] if share > 0.0 else near
        shifted_m, shifted_m_s = ((1.0 - share) * a + share * b for a, b in zip(near, far, strict=True))
        is_known = np.isfinite(shifted_m)
        if is_known.all():
            return shifted_m, shifted_m_s
        level_m, slope_m_s = self._unshifted[:2]
        level_m = np.where(is_known, shifted_m, level_m + slope_m_s * shift_s)
        return level_m, np.where(is_known, shifted_m_s, slope_m_s)

    @property
    def leverage(self) -> Floats:
        """(events,) variance of the level of a line at its event, over that of the noise of a value. [1]."""
        return self._unshifted[2]

    @cached_property
    def _unshifted(self) -> tuple[Floats, Floats, Floats]:
        return self._fitted(0)

    def _fitted(self, later_s: int) -> tuple[Floats, Floats, Floats]:
        """(events,) level, slope and leverage of lines through values so much later; NaN where there is no line."""
        place = self.counted + later_s
        values_m = self.level_m[np.clip(place, 0, self.level_m.size - 1)]
        is_known = self.is_counted & (place >= 0) & (place < self.level_m.size) & np.isfinite(values_m)
        count = is_known.sum(axis=1)
        enough = np.where(count >= self.least, count, np.nan)
        time_s, values_m = (
            np.where(is_known, self.counted - self.late_s - self.second[:, None], 0.0),
            np.where(is_known, values_m, 0.0),
        )
        middle_s, middle_m = time_s.sum(axis=1) / enough, values_m.sum(axis=1) / enough
        about_s = np.where(is_known, time_s - middle_s[:, None], 0.0)
        square = (about_s**2).sum(axis=1) / enough
        slope_m_s = (about_s * values_m).sum(axis=1) / enough / square
        return middle_m - slope_m_s * middle_s, slope_m_s, (1.0 + middle_s**2 / square) / enough


@dataclass(frozen=True, slots=True, kw_only=True)
class Switches:
    """Starts and stops of the controller that follow a straight stretch of the level.

    Attributes
    ----------
    events : tuple of Event
    since_s : (events,) array
        Time since the event before. [s]
    open_s : (events,) array
        Time within which each lies: rows that lie apart do not say when. [s]
    bent_m : (events,) array
        By how much the level may have left its line since the last value. [m]
    stretches : Stretches
    """

    events: tuple[Event, ...]
    since_s: Integers
    open_s: Floats
    bent_m: Floats
    stretches: Stretches

    def of(self, which: Integers) -> "Switches":
        """Some of them."""
        its = self.stretches
        return replace(
            self,
            events=tuple(self.events[k] for k in which),
            since_s=self.since_s[which],
            open_s=self.open_s[which],
            bent_m=self.bent_m[which],
            stretches=replace(
                its, second=its.second[which], counted=its.counted[which], is_counted=its.is_counted[which]
            ),
        )


def switches_of(traces: Traces, station: Station, regimes: Regimes, level_m: Floats) -> Switches:
    """Starts before which the level went up, and stops before which it went down.

    None where rows may hide whole cycles.

    Parameters
    ----------
    traces : Traces
    station : Station
    regimes : Regimes
    level_m : (n,) array
        NaN is "no value". [m]
    """
    rows = np.flatnonzero(traces.is_row)
    found = [] if hides_cycles(traces, station) else list(_found(traces, station, regimes, rows))
    values = ROWS_BEFORE if _lie_apart(traces) else WINDOW_S
    middle_s = (traces.span_s - 1) // 2  # of a mean
    stretches = Stretches(
        second=np.array([event.second for event, *_ in found], dtype=np.int64),
        counted=np.array([before for _, _, before, _ in found], dtype=np.int64).reshape(-1, values) - middle_s,
        is_counted=np.array([counts for *_, counts in found], dtype=np.bool_).reshape(-1, values),
        level_m=np.r_[level_m[middle_s:], np.full(middle_s, np.nan)],
        least=FEWEST_ROWS if _lie_apart(traces) else MIN_LEVELS,
        late_s=0.5 * (traces.span_s - 1) - middle_s,
    )
    after_s = stretches.second - stretches.counted[:, -1]
    switches = Switches(
        events=tuple(event for event, *_ in found),
        since_s=np.array([since_s for _, since_s, *_ in found], dtype=np.int64),
        open_s=np.array([_open_s(event, traces, station, rows) for event, *_ in found]),
        bent_m=np.asarray(after_s * _bend_m_s(traces, stretches, rows), dtype=np.float64),
        stretches=stretches,
    )
    slope_m_s = stretches.lines()[1]
    is_start = np.array([event.is_start for event in switches.events], dtype=np.bool_)
    is_right = slope_m_s * np.where(is_start, 1.0, -1.0) > 0.0
    for way in (True, False) if _lie_apart(traces) else ():
        is_way = is_start == way
        is_right[is_way] &= np.isfinite(slope_m_s[is_way]).sum() >= MOST_OF_THEM * is_way.sum()
    return switches.of(np.flatnonzero(is_right))


def _found(
    traces: Traces, station: Station, regimes: Regimes, rows: Integers
) -> Iterator[tuple[Event, int, Integers, Flags]]:
    """Events of the controller, each with the time since the one before, and the values before it that may count."""
    places = np.searchsorted(rows, [event.second for event in regimes.events], side="right")
    last = -NEVER_S
    for event, place in zip(regimes.events, places.tolist(), strict=True):
        before = _values_before(event, place, traces, rows)
        since_s, begun_s = event.second - last, last
        last = event.second
        is_alone = not _lie_apart(traces) or np.count_nonzero(places == place) == 1
        is_usual = is_alone and 1 <= event.number <= len(station.control.start_levels_m)
        if is_usual and before.size and before[0] >= 0 and _is_of_controller(traces, before[0], event.second + 2):
            is_counted = (before - traces.span_s + 1 > begun_s) & (regimes.of_station[before] != START_RAMP)
            yield event, since_s, before, is_counted


def _lie_apart(traces: Traces) -> bool:
    """Whether values lie apart, and each is of its row: one that is held may be of any time before."""
    return not traces.is_each_second and traces.value != "held"


def _values_before(event: Event, place: int, traces: Traces, rows: Integers) -> Integers:
    """Seconds that tell of the level before an event; none where rows are lost about it, or too few come before.

    `place` is that of the first row after it.
    """
    if not _lie_apart(traces):
        return event.second + np.arange(1 - WINDOW_S, 1)
    if place < ROWS_BEFORE or place == rows.size or rows[place] - rows[place - 1] >= 2.0 * traces.rate_s:
        return rows[:0]
    return rows[place - ROWS_BEFORE : place]


def _open_s(event: Event, traces: Traces, station: Station, rows: Integers) -> float:
    if traces.is_each_second or traces.value != "instant":
        return 0.0
    place = int(np.searchsorted(rows, event.second, side="right"))
    hz, nominal_hz = traces.frequency_hz[event.pump], station.pump[event.pump].nominal_frequency_hz
    share = max(abs(hz[rows[place]] - hz[rows[place - 1]]), MOVED_HZ) / nominal_hz
    return float(traces.drives.open_s[event.pump, rows[place]] / share)


def _bend_m_s(traces: Traces, stretches: Stretches, rows: Integers) -> float:
    """By how much the slope from a value to the next is another one than before, where nothing is switched. [m/s].

    It is the root mean square: an inflow may stand for long, and then change much.
    """
    if not _lie_apart(traces) or rows.size <= ROWS_BEFORE:
        return 0.0
    middle = rows - (traces.span_s - 1) // 2
    counted = np.lib.stride_tricks.sliding_window_view(middle, ROWS_BEFORE)[:-1]
    is_switched = np.any(np.diff(traces.frequency_hz[:, rows], axis=1) != 0.0, axis=0)
    is_calm = ~np.lib.stride_tricks.sliding_window_view(is_switched, ROWS_BEFORE).any(axis=1)
    second, every = middle[ROWS_BEFORE:], np.ones(counted.shape, dtype=np.bool_)
    expected_m = replace(stretches, second=second, counted=counted, is_counted=every, late_s=0.0).lines()[0]
    left_m_s = (stretches.level_m[second] - expected_m) / (second - counted[:, -1])
    left_m_s = left_m_s[is_calm & np.isfinite(left_m_s)]
    return float(np.sqrt(np.mean(left_m_s**2))) if left_m_s.size else 0.0


def _is_of_controller(traces: Traces, begin: int, end: int) -> bool:
    """Whether nobody else commanded the pumps meanwhile, and no recording ended."""
    return not (traces.by_hand.is_commanding[begin:end].any() or np.any(traces.part[begin:end] == BETWEEN))
