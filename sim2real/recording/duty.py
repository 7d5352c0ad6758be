"""Frequencies of each second from their means over intervals: running times, laid where the drives can have run."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.jit import compiled
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.drives import PLACES, STANDING_HZ, Drives
from wetwell.simulator.parameters import plant_parameters

THROUGHOUT = 0.995
"""Share of an interval from which a drive ran for all of it."""
OTHER_COUNT = 1.5
"""Factor by which there may be more or fewer runs in an interval than the wet well lets one expect."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Intervals:
    """Intervals of the rows of means: their last seconds, their length, and the seconds of the recording."""

    last: Integers
    length_s: int
    seconds: int


def drives_of_means(frequency_hz: Floats, running: Floats, intervals: Intervals, station: Station) -> Drives:
    r"""Drives whose mean frequency over each interval is that of the row.

    A drive that ran for a part of an interval ran at its usual speed $v$ for $\bar f \Delta t / v$, next to the
    interval in which it ran on, else in the middle. Where the wet well is emptied within an interval there are

    $$n = s (1 - s) \frac{Q \Delta t}{V}, \qquad s = \min\left(1, \sum_i \bar f_i / v_i\right)$$

    runs of each pump one after the other, V from the start to the stop level: what runs n times in an interval stands
    for $(1 - s) \Delta t / n$ between, in which the inflow of about $s Q$ fills V.

    Parameters
    ----------
    frequency_hz : (pumps, rows) array
        Means; NaN is "no value".
    running : (pumps, rows) array
        Shares of the intervals, NaN where they are not told.
    intervals : Intervals
    station : Station
    """
    nominal_hz = np.array([pump.nominal_frequency_hz for pump in station.pump])
    mean_hz = np.nan_to_num(frequency_hz)
    mean_hz[mean_hz < STANDING_HZ / intervals.length_s] = 0.0
    has_one_speed = station.control.mode == "on_off"  # what is less is a ramp, and a ramp counts as running
    told = np.full_like(running, np.nan) if has_one_speed else running
    speed_hz = np.array(
        [_speeds(mean, share, rated) for mean, share, rated in zip(mean_hz, told, nominal_hz, strict=True)]
    )
    on_s = np.minimum(mean_hz / speed_hz, 1.0) * intervals.length_s
    on_s = np.array([_poured(one, intervals.length_s, station.control.ramp_s) for one in on_s])
    count = _runs(on_s, intervals.length_s, station)

    def laid(place: float, factor: float) -> Floats:
        wanted_hz = np.zeros((len(nominal_hz), intervals.seconds))
        _lay(wanted_hz, on_s, speed_hz, intervals.last, intervals.length_s, np.round(factor * count), place)
        moved_hz = np.empty_like(wanted_hz)
        early_s = round(0.5 * station.control.ramp_s)  # half a ramp is missing at the start, and added at the stop
        for pump, wanted in enumerate(wanted_hz):
            ahead = np.r_[wanted[early_s:], np.full(early_s, wanted[-1])]
            _ramp(ahead, nominal_hz[pump] / station.control.ramp_s, moved_hz[pump])
        return moved_hz

    factors = {"early": 1.0, "late": 1.0, "long": OTHER_COUNT, "short": 1.0 / OTHER_COUNT}
    return Drives(
        frequency_hz=laid(0.5, 1.0),
        placements=tuple(laid(0.5 if factors[name] != 1.0 else PLACES[name][0], factors[name]) for name in PLACES),
        open_s=np.zeros((len(nominal_hz), intervals.seconds)),
    )


def _speeds(mean_hz: Floats, share: Floats, nominal_hz: float) -> Floats:
    """(rows,) speed of a drive while it runs: its mean where it ran throughout, else as it mostly ran."""
    is_full = np.where(np.isfinite(share), share >= THROUGHOUT, mean_hz >= THROUGHOUT * nominal_hz)
    usual_hz = (
        float(np.median(mean_hz[is_full & (mean_hz > 0.0)])) if np.any(is_full & (mean_hz > 0.0)) else nominal_hz
    )
    return np.where(is_full & (mean_hz > 0.0), mean_hz, np.maximum(usual_hz, mean_hz))


def _poured(on_s: Floats, length_s: int, ramp_s: float) -> Floats:
    """(rows,) times of running, those of the intervals over which one ramp goes together on the side that runs.

    Of a ramp an eighth lies before its middle, and is missing after it.
    """
    poured = on_s.copy()
    share = np.r_[0.0, on_s, 0.0] / length_s
    is_part = (share > 0.0) & (share < THROUGHOUT)
    begins = np.flatnonzero(is_part[1:] & ~is_part[:-1])
    ends = np.flatnonzero(~is_part[1:] & is_part[:-1])
    for begin, end in zip(begins, ends, strict=True):
        was_on, goes_on = share[begin] >= THROUGHOUT, share[end + 1] >= THROUGHOUT
        if end - begin < 2 or was_on == goes_on:
            continue
        left_s, together = float(on_s[begin:end].sum()), np.zeros(end - begin)
        for k in range(end - begin) if was_on else range(end - begin - 1, -1, -1):
            together[k] = min(left_s, length_s)
            left_s -= together[k]
        if np.sum(np.abs(together - on_s[begin:end])) < 0.25 * ramp_s + 2.0:
            poured[begin:end] = together
    return poured


def _runs(on_s: Floats, length_s: int, station: Station) -> Floats:
    """(rows,) runs of each pump in an interval by the volume from start to stop; under 1 where they are longer."""
    control = station.control
    if control.is_external:
        return np.zeros(on_s.shape[1])
    volume_m3 = station.sump.mean_area_m2 * (control.start_levels_m[0] - control.stop_levels_m[0])
    carried_m3h = float(np.max(plant_parameters(station).rated_flow_m3h))
    share = np.minimum(on_s.sum(axis=0) / length_s, 1.0)
    active = np.maximum(np.sum(on_s > 0.0, axis=0), 1)
    return np.asarray(share * (1.0 - share) * carried_m3h / 3600.0 * length_s / volume_m3 / active)


@compiled
def _lay(
    wanted_hz: Floats,
    on_s: Floats,
    speed_hz: Floats,
    last: Integers,
    length_s: int,
    count: Floats,
    place: float,
) -> None:
    """Write the commanded frequencies of all intervals."""
    for k in range(last.size):
        begin = last[k] - length_s + 1
        is_alone = k == 0 or last[k] - last[k - 1] != length_s
        ends = k + 1 == last.size or last[k + 1] - last[k] != length_s
        if count[k] >= 1.0:
            _lay_runs(wanted_hz, on_s[:, k], speed_hz[:, k], begin, length_s, count[k], place)
            continue
        for pump in range(on_s.shape[0]):
            ran = not is_alone and on_s[pump, k - 1] > 0.0
            runs_on = not ends and on_s[pump, k + 1] > 0.0
            off_s = length_s - on_s[pump, k]
            first, stop = place * off_s, place * off_s + on_s[pump, k]
            if ran and runs_on:  # it stood in the middle
                first, stop = place * on_s[pump, k] + off_s, place * on_s[pump, k] + length_s
            elif ran:
                first, stop = 0.0, on_s[pump, k]
            elif runs_on:
                first, stop = off_s, float(length_s)
            for second in range(length_s):
                if first <= second < stop or second < stop - length_s:
                    wanted_hz[pump, begin + second] = speed_hz[pump, k]


@compiled
def _lay_runs(
    wanted_hz: Floats, on_s: Floats, speed_hz: Floats, begin: int, length_s: int, count: float, place: float
) -> None:
    """Write those of an interval with several runs of each pump, one pump after the other, with room between them."""
    rest_s, active = float(length_s), 0
    for pump in range(on_s.size):
        rest_s -= on_s[pump]
        active += on_s[pump] > 0.0
    room_s = max(rest_s, 0.0) / max(active, 1) / count
    period_s = length_s / count
    first = place * room_s
    for pump in range(on_s.size):
        run_s = on_s[pump] / count
        for second in range(length_s):
            if (second - first) % period_s < run_s:
                wanted_hz[pump, begin + second] = speed_hz[pump]
        if run_s > 0.0 and not (rest_s < 0.0 and place == 1.0):  # late: those that run together begin together
            first = (first + run_s + room_s) % period_s


@compiled
def _ramp(wanted_hz: Floats, slope: float, moved_hz: Floats) -> None:
    """Frequency of a drive that follows what is wanted along its ramp."""
    now = wanted_hz[0]
    for k in range(wanted_hz.size):
        now += min(max(wanted_hz[k] - now, -slope), slope)
        moved_hz[k] = now
