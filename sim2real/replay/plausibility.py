"""What is no gap but a mistake: values in other units, rows in no order, the file of another station."""

from collections.abc import Mapping

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.regimes import IDLE, STEADY, Regimes
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.replay import Prediction

UNITS: dict[str, dict[str, float]] = {
    "flow_m3h": {"L/s": 1 / 3.6, "m³/s": 1 / 3600.0, "L/min": 1000.0 / 60.0, "m³/d": 24.0, "US gal/min": 4.4029},
    "head_m": {"bar": 1 / 10.197, "kPa": 9.8067, "cm or mbar": 100.0, "mm": 1000.0},
    "power_kw": {"W": 1000.0, "MW": 0.001},
    "level_m": {"cm": 100.0, "mm": 1000.0},
}
"""Readings in other units over those in ours."""
NEAR = 0.25
"""Deviation from such a factor, in its logarithm, that effects may bring about."""
POSSIBLE = (0.3, 3.0)
"""Ratios of recorded and expected values that an effect can still bring about."""
LIKELY = 0.35
"""Logarithm of a ratio that hardly any effect brings about alone."""
LEVEL_SHARE = 0.3
"""Shift of a start level that hardly any effect brings about alone, as a share of the height to the stop."""
MANY = 3
"""Independent parts that are far off from which the file is taken for that of another station."""
MIN_IDLE_S = 600
SHORTEST_RUN_S = 5.0
PERCENT = 0.04


def check_plausible(traces: Traces, station: Station, regimes: Regimes, plain: Prediction) -> None:
    """Refuse what cannot be diagnosed.

    Parameters
    ----------
    traces : Traces
    station : Station
    regimes : Regimes
    plain : Prediction
        Of the station as its file says.

    Raises
    ------
    ValueError
        If values seem to be in other units, rows in no order of time, or the file that of another station; one line.
    """
    _check_order(traces)
    _check_frequency(traces, station)
    ratios = {
        name: _ratio(recorded, plain.signals[name], regimes.of_pumps) for name, recorded in traces.signals.items()
    }
    for name, ratio in ratios.items():
        _check_unit(name, ratio, UNITS[name], "what this station gives")
    inflow_ratio = _inflow_ratio(traces, station, plain)
    _check_unit("inflow_m3h", inflow_ratio, UNITS["flow_m3h"], "what the pumps carry away")
    _check_level(traces, station)
    off = _far_off(traces, station, regimes, ratios, inflow_ratio)
    if len(off) >= MANY:
        raise ValueError(f"this looks like a recording of another station than '{station.name}': {'; '.join(off)}")


def _check_order(traces: Traces) -> None:
    running = traces.frequency_hz > 0.0
    starts = int(np.sum(running[:, 1:] & ~running[:, :-1]))
    run_s = float(running.sum()) / max(starts, 1)
    if run_s < SHORTEST_RUN_S:
        raise ValueError(f"pumps run for {run_s:.1f} s at a time: the rows are in no order of time")


def _check_frequency(traces: Traces, station: Station) -> None:
    nominal_hz = max(pump.nominal_frequency_hz for pump in station.pump)
    running = traces.frequency_hz[traces.frequency_hz > 0.0]
    usual_hz = float(np.quantile(running, 0.9)) if running.size else nominal_hz
    for full, unit, factor in ((100.0, "% of nominal", nominal_hz / 100.0), (1.0, "a share of nominal", nominal_hz)):
        if abs(usual_hz / full - 1.0) < PERCENT and abs(np.log(usual_hz / nominal_hz)) > LIKELY:
            raise ValueError(
                f"frequency_hz reads {usual_hz:.4g} where nominal is {nominal_hz:g} Hz, as if in {unit}: "
                f"prepare the recording with a scale of {factor:.4g}"
            )


def _check_unit(name: str, ratio: float, units: dict[str, float], than: str) -> None:
    if not np.isfinite(ratio) or POSSIBLE[0] * np.exp(NEAR) < ratio < POSSIBLE[1]:
        return
    if ratio <= 0.0:
        raise ValueError(f"{name} reads {ratio:.3g} times {than}: a meter without a signal, or no water")
    for unit, factor in units.items():
        if abs(np.log(ratio / factor)) < NEAR:
            raise ValueError(
                f"{name} reads {ratio:.3g} times {than}, as if in {unit}: "
                f"prepare the recording with a scale of {1.0 / factor:.4g}"
            )
    if not POSSIBLE[0] < ratio < POSSIBLE[1]:
        raise ValueError(f"{name} reads {ratio:.3g} times {than}: a wrong unit, or the file of another station")


def _check_level(traces: Traces, station: Station) -> None:
    control = station.control
    level_m = traces.level_m[np.isfinite(traces.level_m)]
    if level_m.size == 0 or control.is_external:
        return
    ratio = float(np.median(level_m)) / station.middle_level_m
    for unit, factor in UNITS["level_m"].items():
        if ratio > 0.0 and abs(np.log(ratio / factor)) < 2.0 * NEAR:
            raise ValueError(
                f"level_m reads {np.median(level_m):.4g} where the pumps switch at {control.stop_levels_m[0]:g} to "
                f"{control.start_levels_m[0]:g} m, as if in {unit}: prepare the recording with a scale of "
                f"{1.0 / factor:.4g}"
            )
    if not 1.0 / 6.0 < ratio < 6.0:
        raise ValueError(
            f"level_m reads {np.median(level_m):.4g} where the pumps switch at {control.stop_levels_m[0]:g} to "
            f"{control.start_levels_m[0]:g} m: another unit, such as % of a span, or the file of another station"
        )


def _ratio(recorded: Floats, expected: Floats, of_pumps: Integers) -> float:
    """Median of recorded over expected while one pump runs steadily; NaN without any."""
    calm = (of_pumps == STEADY) & np.isfinite(recorded) & (expected > 0.0)
    return float(np.median(recorded[calm] / expected[calm])) if calm.any() else float("nan")


def _inflow_ratio(traces: Traces, station: Station, plain: Prediction) -> float:
    """Mean inflow over the mean of what leaves the wet well: as measured, else by the station's curves."""
    flow_m3h = traces.signals.get("flow_m3h", plain.signals.get("flow_m3h"))
    if traces.inflow_m3h is None or flow_m3h is None:
        return float("nan")
    level_m = traces.level_m[np.isfinite(traces.level_m)]
    rise_m = float(level_m[-1] - level_m[0]) if level_m.size else 0.0
    pumped_m3h = (
        float(np.nanmean(flow_m3h, axis=1).sum()) + 3600.0 * station.sump.mean_area_m2 * rise_m / traces.seconds
    )
    return float(np.mean(traces.inflow_m3h)) / pumped_m3h if pumped_m3h > 0.0 else float("nan")


def _area_ratio(traces: Traces, station: Station, regimes: Regimes) -> float:
    """Area that the inflow and the level of a standing station show, over that of the file."""
    known = (regimes.of_station == IDLE) & np.isfinite(traces.level_m)
    pairs = (
        known[1:] & known[:-1] & ~np.any(traces.signals.get("flow_m3h", np.zeros((1, known.size)))[:, 1:] > 0.0, 0)
    )
    if traces.inflow_m3h is None or pairs.sum() < MIN_IDLE_S:
        return float("nan")
    risen_m = float(np.sum(np.diff(traces.level_m)[pairs]))
    return float(np.sum(traces.inflow_m3h[1:][pairs])) / 3600.0 / station.sump.mean_area_m2 / max(risen_m, 1e-9)


def _far_off(
    traces: Traces, station: Station, regimes: Regimes, ratios: Mapping[AnalogueQuantity, float], inflow_ratio: float
) -> list[str]:
    """Which independent parts are so far off that hardly one effect does it, one line each."""
    area_ratio = _area_ratio(traces, station, regimes)
    hydraulic = {name: ratio for name, ratio in ratios.items() if name != "power_kw"}
    parts = (
        hydraulic,
        {"power_kw": ratios.get("power_kw", float("nan"))},
        {"inflow over pumped flow": inflow_ratio},
        {"area of the wet well": area_ratio},
    )
    off = []
    for part in parts:
        far = [f"{name} is {ratio:.2g} times the expected" for name, ratio in part.items() if _is_far(ratio)]
        off += [" and ".join(far)] if far else []
    control = station.control
    if control.is_external:
        return off
    first = [event for event in regimes.events if event.is_start and event.number == 1]
    seen_m = traces.level_m[[event.second for event in first]]
    depth_m = control.start_levels_m[0] - control.stop_levels_m[0]
    if np.isfinite(seen_m).any() and abs(np.nanmedian(seen_m) - control.start_levels_m[0]) > LEVEL_SHARE * depth_m:
        off.append(f"pumps start at {np.nanmedian(seen_m):.3g} m instead of {control.start_levels_m[0]:g} m")
    return off


def _is_far(ratio: float) -> bool:
    return bool(np.isfinite(ratio)) and abs(float(np.log(max(ratio, 1e-9)))) > LIKELY
