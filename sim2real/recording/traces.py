"""A recording on whole seconds: what the replay is driven by and held against."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.quantities import PUMP_METERS, AnalogueQuantity, pump_column
from wetwell.protocols.recordings.origin import StoredValue
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.recording.drives import Drives, drives_between
from wetwell.sim2real.recording.duty import Intervals, drives_of_means
from wetwell.sim2real.recording.seconds import filled, repeated

MIN_LENGTH_S = 1800
MIN_STARTS = 6
SLOWEST_S = 900
"""Seconds to a row at the most."""
MOST_LOST = 10
"""Time that a recording takes over that of its rows at the slowest rate, at the most."""
EACH_SECOND_S = 1.5
"""Seconds from row to row up to which the recording is one of each second."""


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

    @property
    def seconds(self) -> int:
        """Length. [s]."""
        return int(self.level_m.shape[0])

    @property
    def frequency_hz(self) -> Floats:
        """(pumps, n) frequencies, without NaN; between rows as they were most likely."""
        return self.drives.frequency_hz

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


def traces_of(recording: Recording, station: Station) -> Traces:
    """Recording on whole seconds; rows between are dropped, seconds between rows have no value.

    The seconds of a recording of means begin with the interval of its first row.

    Parameters
    ----------
    recording : Recording
        Prepared: times rise.
    station : Station

    Raises
    ------
    ValueError
        If the numbers of pumps differ, the recording is shorter than half an hour, has no frequency, neither flow
        nor head, or fewer than six starts.
    """
    pumps = len(station.pump)
    if recording.pumps != pumps:
        raise ValueError(f"the recording has {recording.pumps} pumps, station '{station.name}' {pumps}")
    if len(recording) == 0:
        raise ValueError("the recording has no rows")
    if np.any(np.diff(recording.time_ns) <= 0):
        raise ValueError("times must rise: prepare the recording first")
    second = (recording.time_ns - recording.time_ns[0] + NS_PER_S // 2) // NS_PER_S
    rate_s = _rate_s(second)
    before_s = round(rate_s) - 1 if recording.value == "mean" else 0
    second = second + before_s
    seconds = int(second[-1]) + 1

    is_held = recording.value == "held"

    def on_seconds(name: str) -> Floats:
        values = np.full(seconds, np.nan)
        values[second] = recording.column(name)
        return values

    def news(values: Floats) -> Floats:
        return np.where(repeated(values), np.nan, values) if is_held else values

    def of_pumps(quantity: str) -> Floats:
        return np.array([on_seconds(pump_column(i, quantity)) for i in range(1, pumps + 1)])

    signals: dict[AnalogueQuantity, Floats] = {name: of_pumps(name) for name in PUMP_METERS}
    signals = {name: news(values) for name, values in signals.items() if _moves(values)}
    nominal_hz = np.array([[pump.nominal_frequency_hz] for pump in station.pump])
    frequency_hz = of_pumps("frequency_hz")
    frequency_hz = np.where(np.isnan(frequency_hz), of_pumps("running") * nominal_hz, frequency_hz)
    if is_held:
        frequency_hz[:, second] = [filled(values[second], second.size, np.nan) for values in frequency_hz]
    if not np.isfinite(frequency_hz).any():
        raise ValueError("neither frequencies nor running flags have values: no run can be told")
    if before_s > 0:
        intervals = Intervals(last=second, length_s=before_s + 1, seconds=seconds)
        drives = drives_of_means(frequency_hz[:, second], of_pumps("running")[:, second], intervals, station)
    else:
        drives = drives_between(frequency_hz, nominal_hz[:, 0], station.control.ramp_s, rate_s)
    running = drives.frequency_hz > 0.0
    starts = int(np.sum(running[:, 1:] & ~running[:, :-1]))
    if starts < MIN_STARTS:
        raise ValueError(f"the recording has {starts} starts of pumps, a diagnosis needs at least {MIN_STARTS}")
    level_m = news(on_seconds("level_m"))
    if not {"flow_m3h", "head_m"} & signals.keys() and not _moves(level_m):
        raise ValueError("flow, head and level have no values or never move: nothing to hold the simulator against")
    inflow_m3h = on_seconds("inflow_m3h")
    is_row = np.zeros(seconds, dtype=np.bool_)
    is_row[second] = True
    if is_held:
        inflow_m3h = filled(inflow_m3h, seconds, np.nan)
    is_known = np.isfinite(inflow_m3h[is_row]).mean() > 0.5
    return Traces(
        start_ns=int(recording.time_ns[0]) - before_s * NS_PER_S,
        rate_s=rate_s,
        value=recording.value,
        time_s=np.arange(seconds, dtype=np.float64),
        is_row=is_row,
        drives=drives,
        level_m=level_m if _moves(level_m) else np.full(seconds, np.nan),
        inflow_m3h=_inflow_between(inflow_m3h, 1.0 if is_held else rate_s, before_s + 1) if is_known else None,
        signals=signals,
    )


def _inflow_between(inflow_m3h: Floats, rate_s: float, span_s: int) -> Floats:
    """Inflow of each second: of those that were lost the last one, of those between rows along a straight line."""
    if rate_s <= EACH_SECOND_S:
        return filled(inflow_m3h, inflow_m3h.size, 0.0)
    known, place = np.flatnonzero(np.isfinite(inflow_m3h)), np.arange(inflow_m3h.size)
    if span_s > 1:
        return np.asarray(inflow_m3h[known[np.minimum(np.searchsorted(known, place), known.size - 1)]])
    return np.interp(place, known, inflow_m3h[known])


def _moves(values: Floats) -> bool:
    """Whether a channel has values that differ; one that never moves tells nothing."""
    known = values[np.isfinite(values)]
    return bool(known.size) and bool(np.ptp(known) > 0.0)


def _rate_s(second: Integers) -> float:
    """Seconds from row to row of a recording that is long enough and stored often enough."""
    seconds = int(second[-1]) + 1
    if seconds < MIN_LENGTH_S:
        raise ValueError(f"the recording is {seconds} s long, a diagnosis needs at least {MIN_LENGTH_S} s")
    rate_s = max(float(np.median(np.diff(second))), 1.0)
    if rate_s > SLOWEST_S or seconds > MOST_LOST * SLOWEST_S * len(second):
        raise ValueError(
            f"the recording has {len(second)} rows over {seconds} s: a stamp is wrong, or it is sampled more slowly "
            f"than every {SLOWEST_S} s"
        )
    return rate_s
