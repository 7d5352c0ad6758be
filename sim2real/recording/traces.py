"""A recording on whole seconds: what the replay is driven by and held against."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.quantities import PUMP_METERS, AnalogueQuantity, pump_column
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S

HELD_S = 120
"""How long a command is taken to hold on while its value is missing."""
STANDING_HZ = 0.5
"""A frequency under this is a drive at rest."""
MIN_LENGTH_S = 1800
MIN_STARTS = 6
MAX_SPAN = 10
"""Seconds to a row at the most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Traces:
    """One value a second; NaN is "no value". Signals of pumps are (pumps, n), or None where never measured.

    Attributes
    ----------
    start_ns : int
        Time of the first second.
    time_s : (n,) array
        Seconds since then.
    frequency_hz : (pumps, n) array
        Without NaN.
    level_m : (n,) array
    inflow_m3h : (n,) array or None
        Without NaN.
    signals : dict of (pumps, n) arrays
        Of `PUMP_METERS` those that are measured, and move.
    """

    start_ns: int
    time_s: Floats
    frequency_hz: Floats
    level_m: Floats
    inflow_m3h: Floats | None
    signals: dict[AnalogueQuantity, Floats]

    @property
    def seconds(self) -> int:
        """Length. [s]."""
        return int(self.level_m.shape[0])

    @property
    def pumps(self) -> int:
        """Number of pumps."""
        return int(self.frequency_hz.shape[0])


def traces_of(recording: Recording, station: Station) -> Traces:
    """Recording on whole seconds; rows between are dropped, seconds between rows have no value.

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
    seconds = _length_s(second)

    def on_seconds(name: str) -> Floats:
        values = np.full(seconds, np.nan)
        values[second] = recording.column(name)
        return values

    def of_pumps(quantity: str) -> Floats:
        return np.array([on_seconds(pump_column(i, quantity)) for i in range(1, pumps + 1)])

    signals: dict[AnalogueQuantity, Floats] = {name: of_pumps(name) for name in PUMP_METERS}
    signals = {name: values for name, values in signals.items() if _moves(values)}
    nominal_hz = np.array([[pump.nominal_frequency_hz] for pump in station.pump])
    frequency_hz = of_pumps("frequency_hz")
    frequency_hz = np.where(np.isnan(frequency_hz), of_pumps("running") * nominal_hz, frequency_hz)
    if not np.isfinite(frequency_hz).any():
        raise ValueError("neither frequencies nor running flags have values: no run can be told")
    frequency_hz = np.array([filled(values, HELD_S, 0.0) for values in frequency_hz])
    frequency_hz[frequency_hz < STANDING_HZ] = 0.0
    starts = int(np.sum((frequency_hz[:, 1:] > 0.0) & (frequency_hz[:, :-1] == 0.0)))
    if starts < MIN_STARTS:
        raise ValueError(f"the recording has {starts} starts of pumps, a diagnosis needs at least {MIN_STARTS}")
    level_m = on_seconds("level_m")
    if not {"flow_m3h", "head_m"} & signals.keys() and not _moves(level_m):
        raise ValueError("flow, head and level have no values or never move: nothing to hold the simulator against")
    inflow_m3h = on_seconds("inflow_m3h")
    is_known = np.isfinite(inflow_m3h).mean() > 0.5 * (np.unique(second).size / seconds)
    return Traces(
        start_ns=int(recording.time_ns[0]),
        time_s=np.arange(seconds, dtype=np.float64),
        frequency_hz=frequency_hz,
        level_m=level_m if _moves(level_m) else np.full(seconds, np.nan),
        inflow_m3h=filled(inflow_m3h, seconds, 0.0) if is_known else None,
        signals=signals,
    )


def filled(values: Floats, longest: int, otherwise: float) -> Floats:
    """Values with NaN replaced by the last one before, for at most `longest` places; else by `otherwise`.

    Examples
    --------
    >>> filled(np.array([np.nan, 1.0, np.nan, np.nan, 3.0]), 1, 0.0)
    array([0., 1., 1., 0., 3.])
    """
    place = np.arange(values.size)
    last = np.maximum.accumulate(np.where(np.isfinite(values), place, -1))
    held = np.where((last >= 0) & (place - last <= longest), values[last], otherwise)
    return np.asarray(held, dtype=np.float64)


def repeated(values: Floats) -> Flags:
    """(..., n) whether a value is exactly that of the second before; the zeros of a standing pump are not meant."""
    same = np.zeros(values.shape, dtype=bool)
    same[..., 1:] = (values[..., 1:] == values[..., :-1]) & (values[..., 1:] != 0.0)
    return same


def _moves(values: Floats) -> bool:
    """Whether a channel has values that differ; one that never moves tells nothing."""
    known = values[np.isfinite(values)]
    return bool(known.size) and bool(np.ptp(known) > 0.0)


def _length_s(second: Integers) -> int:
    """Length of a recording with rows at these seconds."""
    seconds = int(second[-1]) + 1
    if seconds < MIN_LENGTH_S:
        raise ValueError(f"the recording is {seconds} s long, a diagnosis needs at least {MIN_LENGTH_S} s")
    if seconds > MAX_SPAN * len(second):
        raise ValueError(
            f"the recording has {len(second)} rows over {seconds} s: a stamp is wrong, or it is sampled too slowly"
        )
    return seconds
