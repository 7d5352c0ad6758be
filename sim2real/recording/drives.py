"""Frequencies of each second from those of the rows: what the drives have done between two rows."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.sim2real.recording.seconds import filled

HELD_S = 120
"""How long a command is taken to hold on while its value is missing, and at least for two rows."""
STANDING_HZ = 0.5
"""A frequency under this is a drive at rest."""
MOVED_HZ = 0.05
"""A change of the frequency over this is a command."""
UNKNOWN_S = 1.0
"""A moment is open that is not known to this."""
PLACES = {"early": (0.0, 0.0), "late": (1.0, 1.0), "long": (0.0, 1.0), "short": (1.0, 0.0)}
"""Where in what is possible the rises and the falls of a frequency lie, from 0, as early as can be, to 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drives:
    """Frequencies of each second.

    Attributes
    ----------
    frequency_hz : (pumps, n) array
        Every move in the middle of what is possible.
    placements : tuple of (pumps, n) arrays
        All moves early, all late, all runs long, all short, as `PLACES`; empty where no moment is open.
    open_s : (pumps, n) array
        At the first row after a move: the time within which it may have begun, times the share of nominal that it
        goes over; 0 elsewhere.
    """

    frequency_hz: Floats
    placements: tuple[Floats, ...]
    open_s: Floats


def drives_between(frequency_hz: Floats, nominal_hz: Floats, ramp_s: float, rate_s: float) -> Drives:
    r"""Frequencies of a recording of instants, between its rows.

    Equal neighbours hold. Where they differ the drive went along its ramp,

    $$f(t) = f_a \pm \frac{f_n}{t_r} (t - t_0), \qquad t_a \le t_0 \le t_b - t_r \frac{|f_b - f_a|}{f_n}$$

    and a row within a ramp says when.

    Parameters
    ----------
    frequency_hz : (pumps, n) array
        NaN between rows.
    nominal_hz : (pumps,) array
    ramp_s : float
        From rest to nominal. [s]
    rate_s : float
        From row to row. [s]
    """
    middle = np.array([filled(values, round(max(HELD_S, 2 * rate_s)), 0.0) for values in frequency_hz])
    placements = {name: middle.copy() for name in PLACES}
    open_s = np.zeros(middle.shape)
    for pump, values in enumerate(frequency_hz):
        rows = np.flatnonzero(np.isfinite(values))
        for k in _moves(rows, values[rows], max(HELD_S, 2 * rate_s)):
            begin, end = int(rows[k]), int(rows[k + 1])
            first, last = float(values[begin]), float(values[end])
            is_begun, goes_on = _goes_on(values[rows], k - 1, k), _goes_on(values[rows], k, k + 1)
            fixed = 0.0 if is_begun else 1.0 if goes_on else None
            steepest = abs(last - first) / (end - begin)
            slope = steepest if is_begun and goes_on else max(nominal_hz[pump] / ramp_s, steepest)
            slack_s = end - begin - abs(last - first) / slope
            time_s = np.arange(begin + 1, end) - begin

            def path(place: float, first=first, last=last, slack_s=slack_s, slope=slope, time_s=time_s) -> Floats:
                moved = np.maximum(time_s - place * slack_s, 0.0) * slope
                return first + np.sign(last - first) * np.minimum(moved, abs(last - first))

            middle[pump, begin + 1 : end] = path(0.5 if fixed is None else fixed)
            for name, (rise, fall) in PLACES.items():
                place = rise if last > first else fall
                placements[name][pump, begin + 1 : end] = path(place if fixed is None else fixed)
            if fixed is None and slack_s > UNKNOWN_S:
                open_s[pump, end] = slack_s * abs(last - first) / nominal_hz[pump]
    for one in (middle, *placements.values()):
        one[one < STANDING_HZ] = 0.0
    return Drives(frequency_hz=middle, placements=tuple(placements.values()) if open_s.any() else (), open_s=open_s)


def _moves(rows: Integers, values: Floats, longest_s: float) -> Integers:
    """Rows before a change that is no gap and has seconds in it."""
    apart = np.diff(rows)
    is_move: Flags = (np.abs(np.diff(values)) > MOVED_HZ) & (apart > 1) & (apart <= longest_s)
    return np.flatnonzero(is_move)


def _goes_on(values: Floats, k: int, later: int) -> bool:
    """Whether the frequency moves on between two pairs of rows, in the same direction: it was within a ramp."""
    if min(k, later) < 0 or max(k, later) + 1 >= values.size:
        return False
    first, second = values[k + 1] - values[k], values[later + 1] - values[later]
    return bool(first * second > 0.0 and min(abs(first), abs(second)) > MOVED_HZ)
