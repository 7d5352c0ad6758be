"""Inflow of a station that does not measure it, from level and flows."""

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.recording.checks import check_rising
from wetwell.simulator.duty import duty_flows_m3h
from wetwell.simulator.parameters import plant_parameters
from wetwell.simulator.wet_well import volume_at_level_m3

CHUNK_ROWS = 3600
MIN_STEP_S = 0.1
MAX_INFLOW_M3H = 1440.0
"""The paper's limit of 0.4 m³/s, over which a difference is a spike and no inflow."""
MOST_PUMPED = 2.4
"""The same, as a share of what all pumps of its station move, for larger ones."""


def infer_inflow_m3h(recording: Recording, station: Station, *, window_s: float = 60.0) -> Floats:
    r"""Inflow from the mass balance of the wet well.

    $$Q_{in} = \frac{dV}{dt} + \sum_i Q_i$$

    dV/dt is the slope of a straight line through the volumes within `window_s`: the difference of two samples has a
    noise of A σ √2 / Δt, which at 1 s, 2 mm and 8 m² is 80 m³/h. A pump's flow is the measured one; where it is not
    measured, that of the duty point at the recorded frequency.

    Parameters
    ----------
    recording : Recording
        Times must rise; see `preparation.prepare`.
    station : Station
    window_s : float
        Length of the window, centred. [s]

    Returns
    -------
    inflow_m3h : (n,) array
        NaN where level or flow is missing, at steps under 0.1 s, and where the paper would discard it: negative, or
        over 1,440 m³/h and 2.4 times what all pumps move. [m³/h]

    Raises
    ------
    ValueError
        If times do not rise or there is no level.
    """
    check_rising(recording)
    if "level_m" not in recording.columns:
        raise ValueError("column 'level_m' is missing: without a level the inflow cannot be inferred")
    parameters = plant_parameters(station)
    volume_m3 = np.array([volume_at_level_m3(level_m, parameters.profile) for level_m in recording.column("level_m")])
    time_s = (recording.time_ns - recording.time_ns[0]) / NS_PER_S
    inflow_m3h = 3600.0 * _slopes(time_s, volume_m3, window_s) + pumped_m3h(recording, station)
    too_near = np.concatenate([[False], np.diff(time_s) < MIN_STEP_S])
    most_m3h = max(MAX_INFLOW_M3H, MOST_PUMPED * float(parameters.rated_flow_m3h.sum()))
    inflow_m3h[too_near | (inflow_m3h < 0.0) | (inflow_m3h > most_m3h)] = np.nan
    return inflow_m3h


def pumped_m3h(recording: Recording, station: Station) -> Floats:
    """(n,) flow of all pumps: the measured one, or where it is missing that of the duty point. [m³/h]."""
    parameters = plant_parameters(station)
    pumps = len(station.pump)
    frequency_hz = recording.of_pumps("frequency_hz", pumps)
    running = recording.of_pumps("running", pumps)
    nominal_hz = parameters.nominal_frequency_hz[:, None]
    frequency_hz = np.where(np.isnan(frequency_hz), running * nominal_hz, frequency_hz)
    ratios = np.nan_to_num(frequency_hz / nominal_hz)
    distinct, where = np.unique(np.round(ratios, 4), axis=1, return_inverse=True)
    duty_m3h = np.zeros_like(distinct)
    for column in range(distinct.shape[1]):
        speed_ratio = np.ascontiguousarray(distinct[:, column])
        duty_m3h[:, column] = duty_flows_m3h(parameters, speed_ratio, parameters.rated_level_m)
    measured_m3h = recording.of_pumps("flow_m3h", pumps)
    total: Floats = np.where(np.isnan(measured_m3h), duty_m3h[:, where.ravel()], measured_m3h).sum(axis=0)
    return total


def _slopes(time_s: Floats, values: Floats, window_s: float) -> Floats:
    """(n,) slope of the line through the values within half a window on both sides; NaN with fewer than two."""
    first = np.searchsorted(time_s, time_s - 0.5 * window_s, side="left")
    last = np.searchsorted(time_s, time_s + 0.5 * window_s, side="right")
    slopes = np.empty_like(values)
    for begin in range(0, values.size, CHUNK_ROWS):  # running sums over a month would lose their digits
        rows = slice(begin, min(begin + CHUNK_ROWS, values.size))
        low, high = first[begin], last[rows.stop - 1]
        slopes[rows] = _chunk_slopes(time_s[low:high], values[low:high], first[rows] - low, last[rows] - low)
    return slopes


def _chunk_slopes(time_s: Floats, values: Floats, first: Integers, last: Integers) -> Floats:
    known = np.isfinite(values)
    centred_s = time_s - time_s.mean()
    centred = np.where(known, values - np.mean(values[known]) if known.any() else 0.0, 0.0)

    def within(terms: Floats) -> Floats:
        running = np.concatenate([[0.0], np.cumsum(terms)])
        sums: Floats = running[last] - running[first]
        return sums

    count, sum_t, sum_v = within(known.astype(float)), within(known * centred_s), within(centred)
    spread = within(known * centred_s**2) - sum_t**2 / np.maximum(count, 1.0)
    covariance = within(centred * centred_s) - sum_t * sum_v / np.maximum(count, 1.0)
    slopes: Floats = np.where((count >= 2) & (spread > 0.0), covariance / np.where(spread > 0.0, spread, 1.0), np.nan)
    return slopes
