"""Frequencies of each second from those of the rows: what the drives have done between two rows."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats
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
    longest_s = max(HELD_S, 2.0 * rate_s)
    middle = np.array([filled(values, round(longest_s), 0.0) for values in frequency_hz])
    placements = {name: middle.copy() for name in PLACES}
    open_s = np.zeros(middle.shape)
    for pump, values in enumerate(frequency_hz):
        for move in _moves(values, nominal_hz[pump] / ramp_s, longest_s):
            between = slice(move.begin + 1, move.end)
            middle[pump, between] = move.path(0.5)
            for name, (rise, fall) in PLACES.items():
                placements[name][pump, between] = move.path(rise if move.last > move.first else fall)
            if move.fixed is None and move.slack_s > UNKNOWN_S:
                open_s[pump, move.end] = move.slack_s * abs(move.last - move.first) / nominal_hz[pump]
    for one in (middle, *placements.values()):
        one[one < STANDING_HZ] = 0.0
    return Drives(frequency_hz=middle, placements=tuple(placements.values()) if open_s.any() else (), open_s=open_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Move:
    """A move between two seconds and frequencies; `fixed` is its place where it is known, as in `PLACES`."""

    begin: int
    end: int
    first: float
    last: float
    slope: float
    fixed: float | None

    @property
    def slack_s(self) -> float:
        return self.end - self.begin - abs(self.last - self.first) / self.slope

    def path(self, place: float) -> Floats:
        """Frequencies of the seconds between."""
        begun_s = (place if self.fixed is None else self.fixed) * self.slack_s
        time_s = np.arange(1, self.end - self.begin)
        moved_hz = np.minimum(np.maximum(time_s - begun_s, 0.0) * self.slope, abs(self.last - self.first))
        return np.asarray(self.first + np.sign(self.last - self.first) * moved_hz)


def _moves(frequency_hz: Floats, slope: float, longest_s: float) -> Iterator[_Move]:
    """Changes of the frequency from row to row that are no gap and have seconds in them."""
    rows = np.flatnonzero(np.isfinite(frequency_hz))
    values, apart = frequency_hz[rows], np.diff(rows)
    is_move = (np.abs(np.diff(values)) > MOVED_HZ) & (apart > 1) & (apart <= longest_s)
    for k in np.flatnonzero(is_move).tolist():
        was_moving, moves_on = _goes_on(values, k - 1), _goes_on(values, k)
        steepest = abs(float(values[k + 1] - values[k])) / float(apart[k])
        yield _Move(
            begin=int(rows[k]),
            end=int(rows[k + 1]),
            first=float(values[k]),
            last=float(values[k + 1]),
            slope=steepest if was_moving and moves_on else max(slope, steepest),
            fixed=0.0 if was_moving else 1.0 if moves_on else None,
        )


def _goes_on(values: Floats, k: int) -> bool:
    """Whether the frequency moves on after a row in the direction in which it came: the row lies within a ramp."""
    if k < 0 or k + 2 >= values.size:
        return False
    came, goes = values[k + 1] - values[k], values[k + 2] - values[k + 1]
    return bool(came * goes > 0.0 and min(abs(came), abs(goes)) > MOVED_HZ)
