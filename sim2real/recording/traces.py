"""A recording on whole seconds: what the replay is driven by and held against."""

from dataclasses import dataclass, field

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.quantities import PUMP_METERS, AnalogueQuantity
from wetwell.protocols.recordings.covariates import COVARIATE_PREFIX
from wetwell.protocols.recordings.origin import StoredValue
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.recording.by_hand import ByHand, by_hand_of
from wetwell.sim2real.recording.checks import check_pumps
from wetwell.sim2real.recording.drives import Drives, drives_between
from wetwell.sim2real.recording.duty import Intervals, drives_of_means
from wetwell.sim2real.recording.rows import EACH_SECOND_S, Rows, rows_of

MIN_STARTS = 6
BETWEEN = -1
"""Part of seconds that lie between two recordings, or two parts of one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Traces:
    """One value a second; NaN is "no value". Signals of pumps are (pumps, n), or None where never measured.

    Attributes
    ----------
    start_ns : int
        Time of the first second.
    rate_s : float
        From row to row. [s]
    value : "instant", "mean" or "held"
        What a stored value stands for.
    time_s : (n,) array
        Seconds since then.
    is_row : (n,) array
        Whether there is a row.
    drives : Drives
        Frequencies of all seconds.
    level_m : (n,) array
    inflow_m3h : (n,) array or None
        Without NaN.
    signals : dict of (pumps, n) arrays
        Of `PUMP_METERS` those that are measured, and move.
    by_hand : ByHand
        What a crew did.
    part : (n,) array
        Which of several recordings a second is of, from 0; `BETWEEN` of none.
    columns : dict of (n,) arrays
        Of a user, by name, without NaN: those that have values in most rows.
    """

    start_ns: int
    rate_s: float
    value: StoredValue
    time_s: Floats
    is_row: Flags
    drives: Drives
    level_m: Floats
    inflow_m3h: Floats | None
    signals: dict[AnalogueQuantity, Floats]
    by_hand: ByHand
    part: Integers
    columns: dict[str, Floats] = field(default_factory=dict)

    @property
    def seconds(self) -> int:
        """Length. [s]."""
        return int(self.level_m.shape[0])

    @property
    def clock_s(self) -> Floats:
        """(n,) seconds since 1970, UTC. [s]."""
        return self.start_ns / NS_PER_S + self.time_s

    @property
    def frequency_hz(self) -> Floats:
        """(pumps, n) frequencies, without NaN; between rows as they were most likely."""
        return self.drives.frequency_hz

    @property
    def period(self) -> Integers:
        """(n,) number of the recording that was left alone, from 0: acts by hand belong to what was before them."""
        parts = range(int(self.part.max(initial=0)) + 1)
        is_alone = [not self.by_hand.is_commanding[self.part == part].any() for part in parts]
        number = np.maximum(np.cumsum(is_alone) - 1, 0)
        return np.asarray(number[np.maximum.accumulate(np.maximum(self.part, 0))])

    @property
    def is_each_second(self) -> bool:
        """Whether there is a row each second, but for some that were lost."""
        return self.rate_s <= EACH_SECOND_S

    @property
    def span_s(self) -> int:
        """Seconds that a value is the mean of, up to its own. [s]."""
        return round(self.rate_s) if self.value == "mean" else 1

    @property
    def pumps(self) -> int:
        """Number of pumps."""
        return int(self.frequency_hz.shape[0])


def traces_of(recording: Recording, station: Station, least_starts: int = MIN_STARTS) -> Traces:
    """Recording on whole seconds; rows between are dropped, seconds between rows have no value.

    Parameters
    ----------
    recording : Recording
        Prepared: times rise.
    station : Station
    least_starts : int
        Of pumps; an experiment needs fewer than what stands alone.

    Raises
    ------
    ValueError
        If the numbers of pumps differ, the recording is shorter than half an hour or too slow, has no frequency,
        nothing to be held against, or too few starts.
    """
    pumps = len(station.pump)
    check_pumps(recording, station)
    rows = rows_of(recording)
    signals: dict[AnalogueQuantity, Floats] = {name: rows.of_pumps(name, pumps) for name in PUMP_METERS}
    signals = {name: rows.news(values) for name, values in signals.items() if _moves(values)}
    drives = _drives_of(rows, station)
    check_starts(drives.frequency_hz, least_starts)
    level_m = rows.news(rows.column("level_m"))
    courses = {name: rows.course(COVARIATE_PREFIX + name) for name in recording.covariates}
    if not signals and not _moves(level_m):
        raise ValueError(
            "flow, head, power and level have no values or never move: nothing to hold the simulator against"
        )
    return Traces(
        start_ns=int(recording.time_ns[0]) - (rows.span_s - 1) * NS_PER_S,
        rate_s=rows.rate_s,
        value=recording.value,
        time_s=np.arange(rows.seconds, dtype=np.float64),
        is_row=rows.is_row,
        drives=drives,
        level_m=level_m if _moves(level_m) else np.full(rows.seconds, np.nan),
        inflow_m3h=rows.course("inflow_m3h"),
        signals=signals,
        by_hand=by_hand_of(recording, rows.second, rows.seconds),
        part=np.zeros(rows.seconds, dtype=np.int64),
        columns={name: course for name, course in courses.items() if course is not None},
    )


def check_starts(frequency_hz: Floats, least: int, of: str = "the recording has") -> None:
    """Refuse what has too few starts of pumps to tell anything.

    Raises
    ------
    ValueError
        Says how many, and how many it takes.
    """
    running = frequency_hz > 0.0
    starts = int(np.sum(running[:, 1:] & ~running[:, :-1]))
    if starts < least:
        raise ValueError(f"{of} {starts} starts of pumps, a diagnosis needs at least {least}")


def _drives_of(rows: Rows, station: Station) -> Drives:
    nominal_hz = np.array([pump.nominal_frequency_hz for pump in station.pump])
    frequency_hz = rows.commands(nominal_hz)
    if rows.span_s == 1:
        return drives_between(frequency_hz, nominal_hz, station.control.ramp_s, rows.rate_s)
    intervals = Intervals(last=rows.second, length_s=rows.span_s, seconds=rows.seconds)
    running = rows.of_pumps("running", nominal_hz.size)[:, rows.second]
    return drives_of_means(frequency_hz[:, rows.second], running, intervals, station)


def _moves(values: Floats) -> bool:
    """Whether a channel has values that differ; one that never moves tells nothing."""
    known = values[np.isfinite(values)]
    return bool(known.size) and bool(np.ptp(known) > 0.0)
