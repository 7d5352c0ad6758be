r"""Energy, starts, run time and volume of a recording: the one place where these figures come from.

A row holds until the next one; a mean is that of the interval since the row before. An interval longer than
`max_gap_s` is a gap: it counts no energy, run time or volume; nor does the last row, as nobody knows how long it
held, or the first mean. So the figures of two parts of a recording that share the row at which it was cut add up to
those of the whole.

$$E = \sum_i P_i\, \Delta t_i, \qquad V = \sum_i Q_i\, \Delta t_i, \qquad e = E / V$$
"""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_S

MIN_GAP_S = 10.0
GAP_STEPS = 3.0
"""Without `max_gap_s`, an interval of more than so many usual ones, and of more than `MIN_GAP_S`, is a gap."""

MOST_RATE_PER_H = 1e12
"""No flow and no power is as large: such a reading is none."""
_HOUR_S = 3600
_DAY_S = 86_400


@dataclass(frozen=True, slots=True, kw_only=True)
class Kpis:
    """Figures of a recording; hours and days are those of UTC, without a break from the first to the last.

    A figure is NaN where the recording has not one value to make it from.

    Attributes
    ----------
    step_s : float
        Usual interval between two rows; a start and a stop within one are not seen. 0 for a single row. [s]
    hour_ns : (hours,) int64
        Beginning of each hour since 1970. [ns]
    day_ns : (days,) int64
        Beginning of each day since 1970. [ns]
    hourly_energy_kwh : (pumps, hours) array
        [kWh]
    hourly_volume_m3 : (pumps, hours) array
        [m³]
    hourly_run_h : (pumps, hours) array
        [h]
    hourly_starts : (pumps, hours) int64
    hourly_known_h : (hours,) array
        [h]
    daily_energy_kwh : (pumps, days) array
        [kWh]
    daily_volume_m3 : (pumps, days) array
        Pumped volume, from the measured flow. [m³]
    daily_run_h : (pumps, days) array
        Run time. [h]
    daily_starts : (pumps, days) int64
        Starts; a pump that runs in the first row has not started.
    daily_known_h : (days,) array
        Time outside of gaps. [h]
    """

    step_s: float
    hour_ns: Integers
    day_ns: Integers
    hourly_energy_kwh: Floats
    hourly_volume_m3: Floats
    hourly_run_h: Floats
    hourly_starts: Integers
    hourly_known_h: Floats
    daily_energy_kwh: Floats
    daily_volume_m3: Floats
    daily_run_h: Floats
    daily_starts: Integers
    daily_known_h: Floats

    @property
    def station_hourly_energy_kwh(self) -> Floats:
        """(hours,) energy of all pumps. [kWh]."""
        return np.asarray(self.hourly_energy_kwh.sum(axis=0))

    @property
    def cumulative_energy_kwh(self) -> Floats:
        """(pumps, hours) energy since the beginning, at the end of each hour. [kWh]."""
        return np.cumsum(self.hourly_energy_kwh, axis=1)

    @property
    def energy_kwh(self) -> Floats:
        """(pumps,) energy. [kWh]."""
        return np.asarray(self.daily_energy_kwh.sum(axis=1))

    @property
    def volume_m3(self) -> Floats:
        """(pumps,) pumped volume. [m³]."""
        return np.asarray(self.daily_volume_m3.sum(axis=1))

    @property
    def run_h(self) -> Floats:
        """(pumps,) run time. [h]."""
        return np.asarray(self.daily_run_h.sum(axis=1))

    @property
    def starts(self) -> Integers:
        """(pumps,) starts."""
        return np.asarray(self.daily_starts.sum(axis=1))

    @property
    def specific_energy_kwh_m3(self) -> Floats:
        """(pumps,) energy for each pumped cubic metre; NaN where nothing was pumped. [kWh/m³]."""
        return _ratio(self.energy_kwh, self.volume_m3)

    @property
    def station_specific_energy_kwh_m3(self) -> float:
        """Energy of all pumps for each pumped cubic metre; NaN where nothing was pumped. [kWh/m³]."""
        return float(_ratio(self.energy_kwh.sum(keepdims=True), self.volume_m3.sum(keepdims=True))[0])

    @property
    def duty_share(self) -> Floats:
        """(pumps,) share of each pump in the run time of all, 0..1; NaN where none ran."""
        return _ratio(self.run_h, np.full(self.run_h.size, self.run_h.sum()))


def usual_step_s(stamps_ns: Integers) -> float:
    """Median interval between (n,) rising stamps; 0 for less than two. [s]."""
    return float(np.median(np.diff(stamps_ns))) / NS_PER_S if stamps_ns.size > 1 else 0.0


def longest_step_s(stamps_ns: Integers) -> float:
    """Longest interval between (n,) rising stamps that is no gap: three usual ones, and 10 s at least. [s]."""
    return max(MIN_GAP_S, GAP_STEPS * usual_step_s(stamps_ns))


def kpis(recording: Recording, max_gap_s: float | None = None) -> Kpis:
    """Figures of a recording.

    Rows may be late, doubled, missing or out of order: they are put in the order of their stamps, and the first of
    those with the same stamp counts. A negative power or flow counts as none. A pump runs where its flag says so;
    without flag, where its frequency is above zero; without both, it does not run, and keeps its state for the count
    of starts. A mean of the flag between 0 and 1 is the share of the interval in which it ran.

    Parameters
    ----------
    recording : Recording
    max_gap_s : float, optional
        Longest interval that is no gap, > 0. Default: `GAP_STEPS` times the median interval, at least
        `MIN_GAP_S`. [s]

    Returns
    -------
    kpis : Kpis

    Raises
    ------
    ValueError
        If `max_gap_s` is not positive.

    Examples
    --------
    >>> def column(value):
    ...     return np.full(3601, value)
    >>> hour = Recording(
    ...     time_ns=NS_PER_S * np.arange(3601),
    ...     columns={"pump1_power_kw": column(9.0), "pump1_flow_m3h": column(180.0), "pump1_running": column(1.0)})
    >>> figures = kpis(hour)
    >>> figures.energy_kwh.round(6), figures.volume_m3.round(6), figures.run_h.round(6), figures.starts
    (array([9.]), array([180.]), array([1.]), array([0]))
    >>> round(figures.station_specific_energy_kwh_m3, 6)
    0.05
    """
    if max_gap_s is not None and not max_gap_s > 0.0:
        raise ValueError(f"max_gap_s must be positive, got {max_gap_s:g}")
    stamps_ns, order = np.unique(recording.time_ns, return_index=True)
    interval_ns = np.diff(stamps_ns, append=stamps_ns[-1:])
    if max_gap_s is None:
        max_gap_s = longest_step_s(stamps_ns)
    held_ns = np.where(interval_ns <= max_gap_s * NS_PER_S, interval_ns, 0)
    hour_ns, day_ns = _beginnings_ns(stamps_ns, _HOUR_S), _beginnings_ns(stamps_ns, _DAY_S)
    power_kw, flow_m3h = (recording.of_pumps(name)[:, order] for name in ("power_kw", "flow_m3h"))
    running, run_share = _running(recording)[:, order], _run_share(recording)[:, order]
    known = np.ones(stamps_ns.size)
    if recording.value == "mean":
        power_kw, flow_m3h, run_share = (_since_before(each) for each in (power_kw, flow_m3h, run_share))

    def sums(rates_per_h: Floats, begin_ns: Integers, period_s: int) -> Floats:
        of_pumps = [_sums(rate_per_h, held_ns, stamps_ns, begin_ns, period_s) for rate_per_h in rates_per_h]
        return np.reshape(of_pumps, (recording.pumps, begin_ns.size))

    def starts(begin_ns: Integers, period_s: int) -> Integers:
        started_ns = [stamps_ns[_starts(state)] for state in running]
        period_ns = period_s * NS_PER_S
        of_pumps = [np.bincount((at_ns - begin_ns[:1]) // period_ns, minlength=begin_ns.size) for at_ns in started_ns]
        return np.reshape(np.array(of_pumps, dtype=np.int64), (recording.pumps, begin_ns.size))

    return Kpis(
        step_s=usual_step_s(stamps_ns),
        hour_ns=hour_ns,
        day_ns=day_ns,
        hourly_energy_kwh=sums(power_kw, hour_ns, _HOUR_S),
        hourly_volume_m3=sums(flow_m3h, hour_ns, _HOUR_S),
        hourly_run_h=sums(run_share, hour_ns, _HOUR_S),
        hourly_starts=starts(hour_ns, _HOUR_S),
        hourly_known_h=_sums(known, held_ns, stamps_ns, hour_ns, _HOUR_S),
        daily_energy_kwh=sums(power_kw, day_ns, _DAY_S),
        daily_volume_m3=sums(flow_m3h, day_ns, _DAY_S),
        daily_run_h=sums(run_share, day_ns, _DAY_S),
        daily_starts=starts(day_ns, _DAY_S),
        daily_known_h=_sums(known, held_ns, stamps_ns, day_ns, _DAY_S),
    )


def _ratio(amount: Floats, by: Floats) -> Floats:
    known = by > 0.0
    return np.where(known, amount / np.where(known, by, 1.0), np.nan)


def _beginnings_ns(stamps_ns: Integers, period_s: int) -> Integers:
    """Beginnings of the periods from that of the first stamp to that of the last."""
    if stamps_ns.size == 0:
        return np.empty(0, dtype=np.int64)
    period_ns = period_s * NS_PER_S
    return np.arange(stamps_ns[0] // period_ns, stamps_ns[-1] // period_ns + 1, dtype=np.int64) * period_ns


def _running(recording: Recording) -> Floats:
    """(pumps, n) 1 running, 0 standing, NaN unknown."""
    flag, frequency_hz = recording.of_pumps("running"), recording.of_pumps("frequency_hz")
    state = np.where(np.isnan(flag), frequency_hz, flag)
    return np.where(np.isnan(state), np.nan, state > 0.0)


def _run_share(recording: Recording) -> Floats:
    """(pumps, n) share of the time that a row stands for in which a pump ran; NaN unknown."""
    if recording.value != "mean":
        return _running(recording)
    flag = recording.of_pumps("running")
    return np.where(np.isnan(flag), _running(recording), np.clip(flag, 0.0, 1.0))


def _since_before(means: Floats) -> Floats:
    """(pumps, n) means at the beginning of the interval that each is of; the last row begins none."""
    none = np.full((means.shape[0], min(means.shape[1], 1)), np.nan)
    return np.hstack((means[:, 1:], none))


def _starts(running: Floats) -> Integers:
    """Rows in which a pump is first seen to run after it was last seen to stand."""
    known = np.flatnonzero(~np.isnan(running))
    return known[1:][np.diff(running[known]) > 0.0]


def _sums(rate_per_h: Floats, held_ns: Integers, stamps_ns: Integers, begin_ns: Integers, period_s: int) -> Floats:
    """Integral of a rate over each period; an interval across a boundary is shared in proportion to time."""
    known = np.abs(rate_per_h) < MOST_RATE_PER_H
    if not known.any():
        return np.full(begin_ns.size, np.nan)
    rate_per_ns = np.where(known, np.maximum(rate_per_h, 0.0), 0.0) / (3600.0 * NS_PER_S)
    period_ns = period_s * NS_PER_S
    since_ns = stamps_ns - begin_ns[0]
    crosses = since_ns // period_ns != (since_ns + held_ns) // period_ns
    whole = np.where(crosses, 0.0, rate_per_ns * held_ns)
    sums: Floats = np.bincount(since_ns // period_ns, whole, minlength=begin_ns.size).astype(np.float64)
    for row in np.flatnonzero(crosses):
        at_ns, end_ns = int(since_ns[row]), int(since_ns[row] + held_ns[row])
        while at_ns < end_ns:
            next_ns = min((at_ns // period_ns + 1) * period_ns, end_ns)
            sums[at_ns // period_ns] += rate_per_ns[row] * (next_ns - at_ns)
            at_ns = next_ns
    return sums
