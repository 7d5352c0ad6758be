"""One look at a day: how far each group of signals is from the simulator, by a single replay."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.recording.excerpt import excerpt
from wetwell.sim2real.recording.regimes import REGIMES, regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.plausibility import check_plausible
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.bins import NO_PUMP, SIGNALS, Bins
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.simulator.effects import effects_of

FEWEST_CYCLES_OF_GROUP = 4
"""Cycles without which the scatter of a group between cycles is not known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shift:
    """Mean of a group, recorded minus predicted, in units of what matters; `error` is its standard error.

    A group is a signal of a pump, or of the station, in a regime.
    """

    mean: float
    error: float
    cycles: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """What a replay of a span shows.

    Attributes
    ----------
    start_ns, end_ns : int
        First and last row.
    gap : dict of str to float
        By signal, in units of noise: 1 is noise alone.
    shifts : dict of str to Shift
        By group, such as `flow/1/steady`; pumps from 1, 0 for the station.
    """

    start_ns: int
    end_ns: int
    gap: dict[str, float]
    shifts: dict[str, Shift]


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """A look with the means of each group in each cycle, in the order of time.

    `series` has times [ns] and means of the cycles of a group; a cycle's time is that of its first second.
    """

    look: Look
    series: dict[str, tuple[Integers, Floats]]

    def last(self, length_s: float) -> dict[str, Shift]:
        """Shifts of the last cycles of the look, of groups that have enough of them. [s]."""
        begins_ns = self.look.end_ns - round(length_s * NS_PER_S)
        parts = {name: means[time_ns >= begins_ns] for name, (time_ns, means) in self.series.items()}
        return {name: _shift(means) for name, means in parts.items() if means.size >= FEWEST_CYCLES_OF_GROUP}


def look_at(recording: Recording, station: Station) -> Seen:
    r"""Replay a recording once and say where it departs.

    $$d_g = \frac{1}{n} \sum_c \frac{\overline{z}_{gc}}{\overline{m}_{gc}}, \qquad
    e_g = \frac{s_g}{\sqrt{n}}, \qquad
    g_s = \sqrt{1 + \max(0, \overline{z^2 - z_0^2})}$$

    with the mean residual z and material size m of a group g in a cycle c, the standard deviation s between its n
    cycles, and the gap of a signal s as a diagnosis has it.

    Parameters
    ----------
    recording : Recording
        Prepared: times rise. Columns of truth are not read.
    station : Station
        Its own effects act.

    Raises
    ------
    ValueError
        If recording and station do not fit, or the recording is too short; as a diagnosis.
    """
    traces = excerpt(traces_of(recording, station))
    regimes = regimes_of(traces, station)
    replay = Replay(traces, station, effects_of(station))
    plain = replay.run()
    check_plausible(traces, station, regimes, plain)
    residuals = StationResiduals(traces, station, regimes, plain, replay.doubt)
    bins, z = residuals.bins, residuals.of(plain)
    series = _series(bins, z, traces.start_ns)
    look = Look(
        start_ns=int(recording.time_ns[0]),
        end_ns=int(recording.time_ns[-1]),
        gap={SIGNALS[signal]: _gap(z, bins, bins.signal == signal) for signal in np.unique(bins.signal).tolist()},
        shifts={name: _shift(means) for name, (_, means) in series.items()},
    )
    return Seen(look=look, series=series)


def span_s(recording: Recording) -> float:
    """Time from the first row to the last; 0 without rows. [s]."""
    return float(recording.time_ns[-1] - recording.time_ns[0]) / NS_PER_S if len(recording) else 0.0


def _shift(means: Floats) -> Shift:
    return Shift(mean=float(means.mean()), error=float(means.std(ddof=1) / np.sqrt(means.size)), cycles=means.size)


def _gap(z: Floats, bins: Bins, rows: Flags) -> float:
    return float(np.sqrt(1.0 + max(float(np.mean(z[rows] ** 2 - bins.floor[rows])), 0.0)))


def _series(bins: Bins, z: Floats, start_ns: int) -> dict[str, tuple[Integers, Floats]]:
    """Times and means of the cycles of each group that has enough of them."""
    group = (bins.signal * 64 + bins.pump - NO_PUMP) * len(REGIMES) + bins.regime
    found = {}
    for key in np.unique(group).tolist():
        rows = np.flatnonzero(group == key)
        _, first, of_row = np.unique(bins.cycle[rows], return_index=True, return_inverse=True)
        if first.size < FEWEST_CYCLES_OF_GROUP:
            continue
        means = np.bincount(of_row, z[rows]) / np.bincount(of_row, bins.material[rows])
        signal, pump = divmod(key // len(REGIMES), 64)
        name = f"{SIGNALS[signal]}/{pump}/{REGIMES[key % len(REGIMES)]}"
        found[name] = (start_ns + bins.second[rows][first] * NS_PER_S, np.asarray(means, dtype=np.float64))
    return found
