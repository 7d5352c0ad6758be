"""Steady operating points of a recording: means over segments of each pump run, the raw material of calibration."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.quantities import pump_column
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S

SEGMENT_S = 25.0
WARM_UP_S = 30.0
RAMP_STEP = 0.005
"""A speed ratio that moves by more from one row to the next is a ramp, not a duty."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SteadyPoints:
    """Means over segments in which nothing was switched, (n,) each.

    `run` numbers the pump runs, so that all segments of one can be drawn together; `pump` counts from 0;
    `speed_ratio` is frequency over nominal frequency.
    """

    run: Integers
    pump: Integers
    flow_m3h: Floats
    total_flow_m3h: Floats
    head_m: Floats
    speed_ratio: Floats


def running_flags(recording: Recording, pumps: int) -> Flags:
    """(pumps, n) whether each pump runs: from its flag, or else from its frequency."""
    flags = recording.of_pumps("running", pumps)
    frequency_hz = recording.of_pumps("frequency_hz", pumps)
    running: Flags = np.where(np.isnan(flags), frequency_hz, flags) > 0.0
    return running


def steady_points(recording: Recording, station: Station) -> SteadyPoints:
    """Steady points of all pumps; times must rise."""
    pumps = len(station.pump)
    running = running_flags(recording, pumps)
    time_s = (recording.time_ns - recording.time_ns[0]) / NS_PER_S
    switched = np.concatenate([[True], np.any(running[:, 1:] != running[:, :-1], axis=0)])
    period = np.cumsum(switched) - 1
    since_s = time_s - time_s[switched][period]
    segment = ((since_s - WARM_UP_S) // SEGMENT_S).astype(np.int64)
    flow_m3h = recording.of_pumps("flow_m3h", pumps)
    total_m3h = np.where(running, flow_m3h, 0.0).sum(axis=0)
    parts: list[dict[str, Floats]] = []
    for pump in range(pumps):
        run = np.cumsum(np.diff(running[pump], prepend=False) & running[pump])
        ratio = recording.column(pump_column(pump + 1, "frequency_hz")) / station.pump[pump].nominal_frequency_hz
        steps = np.abs(np.diff(ratio, prepend=ratio[:1], append=ratio[-1:]))
        is_level = np.maximum(steps[1:], steps[:-1]) < RAMP_STEP
        head_m = recording.column(pump_column(pump + 1, "head_m"))
        usable = running[pump] & is_level & (segment >= 0) & np.isfinite(flow_m3h[pump] + head_m + ratio + total_m3h)
        key = period[usable] * 100_000 + segment[usable]
        _, where, counts = np.unique(key, return_inverse=True, return_counts=True)
        whole = (
            counts >= 0.8 * SEGMENT_S / max(float(np.median(np.diff(time_s))), 1.0) if time_s.size > 1 else counts > 0
        )
        rows = {
            "run": run * pumps + pump,
            "pump": np.full(time_s.size, pump),
            "flow_m3h": flow_m3h[pump],
            "total_flow_m3h": total_m3h,
            "head_m": head_m,
            "speed_ratio": ratio,
        }
        sums = {name: np.bincount(where, values[usable].astype(float), counts.size) for name, values in rows.items()}
        parts.append({name: (values / np.maximum(counts, 1))[whole] for name, values in sums.items()})
    means = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    numbers = {name: np.rint(means.pop(name)).astype(np.int64) for name in ("run", "pump")}
    return SteadyPoints(**numbers, **means)
