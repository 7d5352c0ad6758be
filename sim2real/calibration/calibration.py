"""Calibration of a station file from a recording: what it can tell, with intervals, and what it cannot."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import ValidationError

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.errors import first_fault
from wetwell.protocols.quantities import pump_column
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.calibration.steady import SteadyPoints, running_flags, steady_points

RESAMPLES = 200
CONFIDENCE = 0.95
MIN_RUNS = 4
SPREAD_NEEDED = 0.08
"""Relative spread of the flow (of Q/N, or of Q²) over which a slope can be told from an offset."""
BESIDE_SWITCH_S = 60.0
RAMP_ALLOWANCE_S = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """One parameter: its value with a 95 % interval, or why it cannot be told; `value` is then the configured one."""

    name: str
    unit: str
    value: float
    interval: tuple[float, float] | None
    reason: str = ""


def calibrate(recording: Recording, station: Station, *, seed: int = 0) -> tuple[Estimate, ...]:
    """Estimates of curve, system curve, area, levels and ramp, with intervals by a bootstrap over whole runs.

    At one operating point a curve has one degree of freedom: then the shut-off head moves and the slopes stay those
    of the file; friction moves and the static head stays. Only where the flow has varied (drive, several pumps on a
    common header) are more of them estimated. Start ramps are never used for curves: damped meters bias them.

    Parameters
    ----------
    recording : Recording
        Prepared: times rise.
    station : Station
        Starting point, and what is kept where the recording cannot tell.
    seed : int
        Of the bootstrap.

    Raises
    ------
    ValueError
        If times do not rise.
    """
    if np.any(np.diff(recording.time_ns) <= 0):
        raise ValueError("times must rise: prepare the recording first")
    rng = np.random.default_rng(seed)
    points = steady_points(recording, station)
    estimates: list[Estimate] = []
    for pump in range(len(station.pump)):
        estimates += _pump_curve(points, station, pump, rng)
    estimates += _system_curve(points, station, rng)
    estimates.append(_area(recording, station, rng))
    estimates += _levels(recording, station, rng)
    estimates.append(_ramp(recording, station, rng))
    return tuple(estimates)


def _pump_curve(points: SteadyPoints, station: Station, pump: int, rng: np.random.Generator) -> list[Estimate]:
    c0, c1, c2 = station.pump[pump].coefficients
    names = [(f"pump[{pump + 1}].c{power}", unit) for power, unit in enumerate(("m", "m/(m³/h)", "m/(m³/h)²"))]
    mine = points.pump == pump
    runs = points.run[mine]
    if np.unique(runs).size < MIN_RUNS:
        reason = f"{np.unique(runs).size} runs with steady flow, head and frequency, at least {MIN_RUNS} are needed"
        return [_kept(name, unit, value, reason) for (name, unit), value in zip(names, (c0, c1, c2), strict=True)]
    flow = points.flow_m3h[mine] / points.speed_ratio[mine]
    head = points.head_m[mine] / points.speed_ratio[mine] ** 2
    if np.std(flow) > SPREAD_NEEDED * np.mean(flow):
        scale = np.mean(flow)
        design = np.column_stack([np.ones_like(flow), flow / scale, (flow / scale) ** 2])

        def curve(rows: Integers) -> Floats:
            fitted: Floats = np.linalg.lstsq(design[rows], head[rows], rcond=None)[0] / scale ** np.arange(3)
            return fitted

        values, low, high = _bootstrap(curve, runs, rng)
        return [
            Estimate(name=name, unit=unit, value=values[k], interval=(low[k], high[k]))
            for k, (name, unit) in enumerate(names)
        ]
    rest = head - c1 * flow - c2 * flow**2
    values, low, high = _bootstrap(_mean_of(rest), runs, rng)
    reason = f"the flow varies by {np.std(flow) / np.mean(flow):.1%} only: one point of the curve, no slope"
    return [
        Estimate(name=names[0][0], unit="m", value=values[0], interval=(low[0], high[0])),
        *(_kept(name, unit, value, reason) for (name, unit), value in zip(names[1:], (c1, c2), strict=True)),
    ]


def _system_curve(points: SteadyPoints, station: Station, rng: np.random.Generator) -> list[Estimate]:
    main = station.rising_main
    total = points.total_flow_m3h if main.layout == "common" else points.flow_m3h
    if np.unique(points.run).size < MIN_RUNS:
        reason = "too few runs with steady flow and head"
        return [
            _kept("rising_main.static_head_m", "m", main.static_head_m, reason),
            _kept("rising_main.friction_h2_m5", "h²/m⁵", main.friction_h2_m5, reason),
        ]
    squared = total**2
    if np.std(squared) > SPREAD_NEEDED * np.mean(squared):
        scale = np.mean(squared)
        design = np.column_stack([np.ones_like(squared), squared / scale])

        def curve(rows: Integers) -> Floats:
            fitted: Floats = np.linalg.lstsq(design[rows], points.head_m[rows], rcond=None)[0] / [1.0, scale]
            return fitted

        values, low, high = _bootstrap(curve, points.run, rng)
        return [
            Estimate(name="rising_main.static_head_m", unit="m", value=values[0], interval=(low[0], high[0])),
            Estimate(name="rising_main.friction_h2_m5", unit="h²/m⁵", value=values[1], interval=(low[1], high[1])),
        ]
    friction = (points.head_m - main.static_head_m) / squared
    values, low, high = _bootstrap(_mean_of(friction), points.run, rng)
    reason = "one operating point: static head and friction cannot be told apart, the static head is kept"
    return [
        _kept("rising_main.static_head_m", "m", main.static_head_m, reason),
        Estimate(name="rising_main.friction_h2_m5", unit="h²/m⁵", value=values[0], interval=(low[0], high[0])),
    ]


def _area(recording: Recording, station: Station, rng: np.random.Generator) -> Estimate:
    """Area from the change of the level's slope when pumps start and stop: A Δ(dL/dt) = −Δ(ΣQ), inflow unchanged."""
    name, unit, configured = "sump.area_m2", "m²", station.sump.area_m2
    if station.sump.profile is not None:
        return _kept(name, unit, configured, "the file gives a profile")
    pumps = len(station.pump)
    running = running_flags(recording, pumps)
    flow_m3h = recording.of_pumps("flow_m3h", pumps)
    total_m3h = np.where(running, flow_m3h, 0.0).sum(axis=0)
    time_s = (recording.time_ns - recording.time_ns[0]) / NS_PER_S
    level_m = recording.column("level_m")
    ramp_s = station.control.ramp_s + station.control.dwell_s + RAMP_ALLOWANCE_S
    switches = np.flatnonzero(np.any(running[:, 1:] != running[:, :-1], axis=0)) + 1
    slopes, flows = [], []
    for row in switches:
        sides = []
        for begin_s, end_s in ((-BESIDE_SWITCH_S - ramp_s, -ramp_s), (ramp_s, ramp_s + BESIDE_SWITCH_S)):
            low, high = np.searchsorted(time_s, time_s[row] + np.array([begin_s, end_s]))
            window = slice(low, high)
            usable = np.isfinite(level_m[window]) & np.isfinite(total_m3h[window])
            is_calm = high > low and not np.any(running[:, window] != running[:, low : low + 1])
            if usable.sum() < 0.5 * BESIDE_SWITCH_S or not is_calm:
                break
            slope = np.polyfit(time_s[window][usable] - time_s[row], level_m[window][usable], 1)[0]
            sides.append((3600.0 * slope, total_m3h[window][usable].mean()))
        if len(sides) == 2:
            slopes.append(sides[1][0] - sides[0][0])
            flows.append(sides[1][1] - sides[0][1])
    if len(slopes) < MIN_RUNS:
        return _kept(name, unit, configured, f"{len(slopes)} switches with a calm minute on both sides")
    change_m_h, change_m3h = np.array(slopes), np.array(flows)

    def area(rows: Integers) -> Floats:
        """Slopes carry the noise, flows hardly any: regress slopes on flows."""
        return np.array([-np.sum(change_m3h[rows] ** 2) / np.sum(change_m3h[rows] * change_m_h[rows])])

    values, low, high = _bootstrap(area, np.arange(change_m_h.size), rng)
    return Estimate(name=name, unit=unit, value=values[0], interval=(low[0], high[0]))


def _levels(recording: Recording, station: Station, rng: np.random.Generator) -> list[Estimate]:
    """Levels at which the n-th pump was started and stopped: the reading of the second before the frequency moved."""
    pumps = len(station.pump)
    running = running_flags(recording, pumps)
    frequency_hz = np.nan_to_num(recording.of_pumps("frequency_hz", pumps))
    level_m = recording.column("level_m")
    rising = (frequency_hz[:, 1:] > 0) & (frequency_hz[:, :-1] == 0)
    falling = (frequency_hz[:, 1:] < frequency_hz[:, :-1]) & (
        frequency_hz[:, :-1] == frequency_hz.max(axis=1)[:, None]
    )
    estimates = []
    for kind, events, configured in (
        ("start", rising, station.control.start_levels_m),
        ("stop", falling, station.control.stop_levels_m),
    ):
        for n, level in enumerate(configured, start=1):
            name = f"control.{kind}_levels_m[{n}]"
            rows = np.flatnonzero(events.any(axis=0))
            others = running[:, rows].sum(axis=0) - (kind == "stop")
            seen = level_m[rows[others == n - 1]]
            seen = seen[np.isfinite(seen)]
            if seen.size < MIN_RUNS:
                estimates.append(_kept(name, "m", level, f"{seen.size} such events"))
                continue
            rate_m = np.median(np.abs(np.diff(level_m[np.isfinite(level_m)]))) / 2.0
            offset_m = -rate_m if kind == "start" else rate_m
            values, low, high = _bootstrap(_mean_of(seen + offset_m), np.arange(seen.size), rng)
            estimates.append(
                Estimate(
                    name=name, unit="m", value=values[0], interval=(low[0] - float(rate_m), high[0] + float(rate_m))
                )
            )
    return estimates


def _ramp(recording: Recording, station: Station, rng: np.random.Generator) -> Estimate:
    times_s = []
    for i, pump in enumerate(station.pump, start=1):
        frequency_hz = recording.column(pump_column(i, "frequency_hz"))
        step_s = np.diff(recording.time_ns) / NS_PER_S
        rate = np.diff(frequency_hz) / step_s
        inner = (rate > 0) & (frequency_hz[:-1] > 0) & (frequency_hz[1:] < 0.99 * pump.nominal_frequency_hz)
        times_s += (pump.nominal_frequency_hz / rate[inner]).tolist()
    if len(times_s) < MIN_RUNS:
        return _kept("control.ramp_s", "s", station.control.ramp_s, "no frequency in the recording rises in steps")
    seen = np.array(times_s)
    values, low, high = _bootstrap(lambda rows: np.array([np.median(seen[rows])]), np.arange(seen.size), rng)
    return Estimate(name="control.ramp_s", unit="s", value=values[0], interval=(low[0], high[0]))


def _mean_of(values: Floats) -> Callable[[Integers], Floats]:
    return lambda rows: np.array([values[rows].mean()])


def _kept(name: str, unit: str, value: float, reason: str) -> Estimate:
    return Estimate(name=name, unit=unit, value=value, interval=None, reason=reason)


def _bootstrap(
    estimate: Callable[[Integers], Floats], groups: Integers, rng: np.random.Generator
) -> tuple[list[float], list[float], list[float]]:
    """Estimate on all rows, and its percentile interval under resampling of whole groups."""
    members = [np.flatnonzero(groups == group) for group in np.unique(groups)]
    value = estimate(np.arange(groups.size))
    drawn = [
        estimate(np.concatenate([members[k] for k in rng.integers(0, len(members), len(members))]))
        for _ in range(RESAMPLES)
    ]
    low, high = np.quantile(np.array(drawn), [(1.0 - CONFIDENCE) / 2.0, (1.0 + CONFIDENCE) / 2.0], axis=0)
    return value.tolist(), low.tolist(), high.tolist()


def with_estimates(station: Station, estimates: Sequence[Estimate]) -> Station:
    """Station with what was estimated in the place of what was configured; the rest stays.

    Raises
    ------
    ValueError
        If the estimates cannot be a station together, such as a stop level over its start level.
    """
    tree = station.model_dump(exclude_none=True)
    for estimate in estimates:
        if estimate.interval is None:
            continue
        table, _, key = estimate.name.partition(".")
        if table.startswith("pump["):
            pump = tree["pump"][int(table[5:-1]) - 1]
            curve = list(pump.get("curve") or station.pump[int(table[5:-1]) - 1].coefficients)
            curve[int(key[1])] = estimate.value
            pump.pop("points", None)
            pump["curve"] = curve
        elif key.endswith("]"):
            name, _, number = key[:-1].partition("[")
            levels = list(tree[table][name])
            levels[int(number) - 1] = estimate.value
            tree[table][name] = levels
        else:
            tree[table][key] = estimate.value
    try:
        return Station.model_validate(tree)
    except ValidationError as error:
        raise ValueError(f"the estimates do not make a station: {first_fault(error)}") from error
