"""What the moments tell in which pumps are started and stopped: area of the wet well, levels of the control, ramp."""

from dataclasses import replace

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.quantities import pump_column
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.calibration.estimates import Estimate, estimated
from wetwell.sim2real.calibration.steady import Running

MIN_EVENTS = 4
"""Events from which on a bootstrap over them says something."""
BESIDE_SWITCH_S = 60.0
"""Length of the window on each side of a switch, over which the inflow is taken as the same. [s]"""
MIN_ROWS = 4
"""Rows in a window at the least, so that the level in it has a slope."""
RAMP_ALLOWANCE_S = 5.0


def area_estimate(recording: Recording, station: Station, running: Running, rng: np.random.Generator) -> Estimate:
    """Area from the change of the level's slope when pumps start and stop: A Δ(dL/dt) = −Δ(ΣQ), inflow unchanged."""
    sump = station.sump
    parameter = Estimate(name="sump.area_m2", unit="m²", value=sump.mean_area_m2, place=("sump", "area_m2"))
    if sump.profile is not None or sump.volume_points is not None:
        return parameter.kept("the file gives its shape")
    if running.step_s * MIN_ROWS > BESIDE_SWITCH_S:
        return parameter.kept(f"a row every {running.step_s:g} s does not show how the level bends at a switch")
    change_m_h, change_m3h = _bends(recording, station, running)
    if change_m_h.size < MIN_EVENTS:
        return parameter.kept(f"{change_m_h.size} switches with a calm minute on both sides")
    if np.sum(change_m3h * change_m_h) >= 0.0:
        return parameter.kept("the level does not bend down where pumps start")

    def area_m2(events: Integers) -> float:
        """Slopes carry the noise, flows hardly any: regress slopes on flows."""
        return float(-np.sum(change_m3h[events] ** 2) / np.sum(change_m3h[events] * change_m_h[events]))

    return estimated(parameter, area_m2, change_m_h.size, rng)


def _bends(recording: Recording, station: Station, running: Running) -> tuple[Floats, Floats]:
    """Changes of the slope of the level and of the total flow at switches with calm water. [m/h, m³/h]."""
    pumps = len(station.pump)
    is_running, time_s = running.running, running.time_s
    total_m3h = np.where(is_running, recording.of_pumps("flow_m3h", pumps), 0.0).sum(axis=0)
    level_m = recording.column("level_m")
    away_s = station.control.ramp_s + station.control.dwell_s + max(RAMP_ALLOWANCE_S, running.step_s)
    slopes, flows = [], []
    for row in np.flatnonzero(np.any(is_running[:, 1:] != is_running[:, :-1], axis=0)) + 1:
        sides = []
        for begin_s, end_s in ((-BESIDE_SWITCH_S - away_s, -away_s), (away_s, away_s + BESIDE_SWITCH_S)):
            low, high = np.searchsorted(time_s, time_s[row] + np.array([begin_s, end_s]))
            window = slice(low, high)
            usable = np.isfinite(level_m[window]) & np.isfinite(total_m3h[window])
            is_calm = high > low and not np.any(is_running[:, window] != is_running[:, low : low + 1])
            if usable.sum() * max(running.step_s, 1.0) < 0.5 * BESIDE_SWITCH_S or usable.sum() < 2 or not is_calm:
                break
            slope = np.polyfit(time_s[window][usable] - time_s[row], level_m[window][usable], 1)[0]
            sides.append((3600.0 * slope, total_m3h[window][usable].mean()))
        if len(sides) == 2:
            slopes.append(sides[1][0] - sides[0][0])
            flows.append(sides[1][1] - sides[0][1])
    return np.array(slopes), np.array(flows)


def level_estimates(
    recording: Recording, station: Station, running: Running, rng: np.random.Generator
) -> list[Estimate]:
    """Levels at which the n-th pump was started and stopped; none of a station that is not driven by levels.

    The control saw the level up to a second before the frequency moved, somewhere between two rows: the interval is
    wider by what the level moves in half a row.
    """
    control = station.control
    if control.is_external:
        return []
    frequency_hz = np.nan_to_num(recording.of_pumps("frequency_hz", len(station.pump)))
    level_m = recording.column("level_m")
    known_m = level_m[np.isfinite(level_m)]
    half_row_m = float(np.median(np.abs(np.diff(known_m))) / 2.0) if known_m.size > 1 else 0.0
    passed = (running.step_s - 2.0) / max(running.step_s, 1.0)
    rising = (frequency_hz[:, 1:] > 0) & (frequency_hz[:, :-1] == 0)
    falling = (frequency_hz[:, 1:] < frequency_hz[:, :-1]) & (
        frequency_hz[:, :-1] == frequency_hz.max(axis=1, initial=0.0)[:, None]
    )
    estimates = []
    for kind, events, configured in (
        ("start", rising, control.start_levels_m),
        ("stop", falling, control.stop_levels_m),
    ):
        offset_m = half_row_m * passed * (1.0 if kind == "start" else -1.0)
        for n, configured_m in enumerate(configured, start=1):
            key = f"{kind}_levels_m"
            parameter = Estimate(
                name=f"control.{key}[{n}]", unit="m", value=configured_m, place=("control", key, n - 1)
            )
            rows = np.flatnonzero(events.any(axis=0))
            others = running.running[:, rows].sum(axis=0) - (kind == "stop")
            seen_m = level_m[rows[others == n - 1]]
            seen_m = seen_m[np.isfinite(seen_m)] + offset_m
            if seen_m.size < MIN_EVENTS:
                estimates.append(parameter.kept(f"{seen_m.size} such events"))
                continue
            mean = estimated(parameter, lambda events, seen_m=seen_m: float(seen_m[events].mean()), seen_m.size, rng)  # type: ignore[misc]
            low_m, high_m = mean.interval or (mean.value, mean.value)
            estimates.append(replace(mean, interval=(low_m - half_row_m, high_m + half_row_m)))
    return estimates


def ramp_estimate(recording: Recording, station: Station, running: Running, rng: np.random.Generator) -> Estimate:
    """Time from standstill to nominal frequency, from rows within a ramp."""
    control = station.control
    parameter = Estimate(name="control.ramp_s", unit="s", value=control.ramp_s, place=("control", "ramp_s"))
    if running.step_s >= control.ramp_s:
        return parameter.kept(f"a row every {running.step_s:g} s does not show a ramp of {control.ramp_s:g} s")
    times_s: list[float] = []
    for i, pump in enumerate(station.pump, start=1):
        frequency_hz = recording.column(pump_column(i, "frequency_hz"))
        rate = np.diff(frequency_hz) / np.diff(running.time_s)
        inner = (rate > 0) & (frequency_hz[:-1] > 0) & (frequency_hz[1:] < 0.99 * pump.nominal_frequency_hz)
        times_s += (pump.nominal_frequency_hz / rate[inner]).tolist()
    if len(times_s) < MIN_EVENTS:
        return parameter.kept("no frequency in the recording rises in steps")
    seen_s = np.array(times_s)
    return estimated(parameter, lambda events: float(np.median(seen_s[events])), seen_s.size, rng)
