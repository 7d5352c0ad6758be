"""Calibration of a station file from a recording: what it can tell, with intervals, and what it cannot."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from pydantic import ValidationError

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.errors import first_fault
from wetwell.protocols.quantities import pump_column
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.calibration.estimates import (
    Estimate,
    estimated,
    is_spread,
    mean_estimated,
    polynomial_estimated,
)
from wetwell.sim2real.calibration.steady import SteadyPoints, running_flags, steady_points

MIN_RUNS = 4
BESIDE_SWITCH_S = 60.0
RAMP_ALLOWANCE_S = 5.0
CURVE_UNITS = ("m", "m/(m³/h)", "m/(m³/h)²")


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
    estimates += _area(recording, station, rng)
    estimates += _levels(recording, station, rng)
    estimates += _ramp(recording, station, rng)
    return tuple(estimates)


def _pump_curve(points: SteadyPoints, station: Station, pump: int, rng: np.random.Generator) -> list[Estimate]:
    c0, c1, c2 = station.pump[pump].coefficients
    parameters = [
        Estimate(name=f"pump[{pump + 1}].c{power}", unit=CURVE_UNITS[power], value=configured)
        for power, configured in enumerate((c0, c1, c2))
    ]
    mine = points.pump == pump
    runs = points.run[mine]
    count = np.unique(runs).size
    if count < MIN_RUNS:
        reason = f"{count} runs with steady flow, head and frequency, at least {MIN_RUNS} are needed"
        return [parameter.kept(reason) for parameter in parameters]
    flow = points.flow_m3h[mine] / points.speed_ratio[mine]
    head = points.head_m[mine] / points.speed_ratio[mine] ** 2
    if is_spread(flow):
        return polynomial_estimated(parameters, flow, head, runs, rng)
    reason = f"the flow varies by {np.std(flow) / np.mean(flow):.1%} only: one point of the curve, no slope"
    offset = mean_estimated(parameters[0], head - c1 * flow - c2 * flow**2, runs, rng)
    return offset + [parameter.kept(reason) for parameter in parameters[1:]]


def _system_curve(points: SteadyPoints, station: Station, rng: np.random.Generator) -> list[Estimate]:
    main = station.mains[0]
    head = Estimate(name="rising_main.static_head_m", unit="m", value=main.lift_at_zero_m)
    friction = Estimate(name="rising_main.friction_h2_m5", unit="h²/m⁵", value=main.friction_h2_m5)
    if len(station.mains) > 1 or main.delivery_level_m is not None:
        return [parameter.kept("the file has several mains, or a delivery level") for parameter in (head, friction)]
    if np.unique(points.run).size < MIN_RUNS:
        return [parameter.kept("too few runs with steady flow and head") for parameter in (head, friction)]
    squared = (points.total_flow_m3h if main.layout == "common" else points.flow_m3h) ** 2
    if is_spread(squared):
        return polynomial_estimated([head, friction], squared, points.head_m, points.run, rng)
    reason = "one operating point: static head and friction cannot be told apart, the static head is kept"
    rest = (points.head_m - main.lift_at_zero_m) / squared
    return [head.kept(reason), *mean_estimated(friction, rest, points.run, rng)]


def _area(recording: Recording, station: Station, rng: np.random.Generator) -> list[Estimate]:
    """Area from the change of the level's slope when pumps start and stop: A Δ(dL/dt) = −Δ(ΣQ), inflow unchanged."""
    parameter = Estimate(name="sump.area_m2", unit="m²", value=station.sump.mean_area_m2)
    if station.sump.profile is not None or station.sump.volume_points is not None:
        return [parameter.kept("the file gives a profile")]
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
        return [parameter.kept(f"{len(slopes)} switches with a calm minute on both sides")]
    change_m_h, change_m3h = np.array(slopes), np.array(flows)

    def area(rows: Integers) -> Floats:
        """Slopes carry the noise, flows hardly any: regress slopes on flows."""
        return np.array([-np.sum(change_m3h[rows] ** 2) / np.sum(change_m3h[rows] * change_m_h[rows])])

    return estimated([parameter], area, np.arange(change_m_h.size), rng)


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
            parameter = Estimate(name=f"control.{kind}_levels_m[{n}]", unit="m", value=level)
            rows = np.flatnonzero(events.any(axis=0))
            others = running[:, rows].sum(axis=0) - (kind == "stop")
            seen = level_m[rows[others == n - 1]]
            seen = seen[np.isfinite(seen)]
            if seen.size < MIN_RUNS:
                estimates.append(parameter.kept(f"{seen.size} such events"))
                continue
            rate_m = float(np.median(np.abs(np.diff(level_m[np.isfinite(level_m)]))) / 2.0)
            offset_m = -rate_m if kind == "start" else rate_m
            (mean,) = mean_estimated(parameter, seen + offset_m, np.arange(seen.size), rng)
            low_m, high_m = mean.interval or (mean.value, mean.value)
            estimates.append(replace(mean, interval=(low_m - rate_m, high_m + rate_m)))
    return estimates


def _ramp(recording: Recording, station: Station, rng: np.random.Generator) -> list[Estimate]:
    parameter = Estimate(name="control.ramp_s", unit="s", value=station.control.ramp_s)
    times_s = []
    for i, pump in enumerate(station.pump, start=1):
        frequency_hz = recording.column(pump_column(i, "frequency_hz"))
        step_s = np.diff(recording.time_ns) / NS_PER_S
        rate = np.diff(frequency_hz) / step_s
        inner = (rate > 0) & (frequency_hz[:-1] > 0) & (frequency_hz[1:] < 0.99 * pump.nominal_frequency_hz)
        times_s += (pump.nominal_frequency_hz / rate[inner]).tolist()
    if len(times_s) < MIN_RUNS:
        return [parameter.kept("no frequency in the recording rises in steps")]
    seen = np.array(times_s)
    return estimated([parameter], lambda rows: np.array([np.median(seen[rows])]), np.arange(seen.size), rng)


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
