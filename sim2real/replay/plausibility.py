"""What is no gap but a mistake: values in other units, rows in no order, the file of another station."""

from collections.abc import Mapping

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.regimes import IDLE, STEADY, Regimes
from wetwell.sim2real.recording.seconds import filled
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.replay import Prediction
from wetwell.sim2real.replay.units import (
    LIKELY,
    NEAR,
    check_frequency,
    check_level_unit,
    said_of,
    unit_near,
    usual_level_m,
    where_pumps_switch,
)

POSSIBLE = (0.3, 3.0)
"""Ratios of recorded and expected values that an effect can still bring about."""
LEVEL_SHARE = 0.3
"""Shift of a start level that hardly any effect brings about alone, as a share of the height to the stop."""
MANY = 3
"""Independent parts that are far off from which the file is taken for that of another station."""
MIN_IDLE_S = 600
SHORTEST_RUN_S = 5.0


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
    check_frequency(traces, station)
    ratios = {
        name: _ratio(recorded, plain.signals[name], regimes.of_pumps) for name, recorded in traces.signals.items()
    }
    for name, ratio in ratios.items():
        _check_unit(name, name, ratio, "what this station gives")
    inflow_ratio = _inflow_ratio(traces, station, plain)
    _check_unit("inflow_m3h", "flow_m3h", inflow_ratio, "what the pumps carry away")
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


def _check_unit(name: str, quantity: str, ratio: float, than: str) -> None:
    """Refuse a ratio of what was recorded to what is expected that a unit brings about, or nothing."""
    if not np.isfinite(ratio) or POSSIBLE[0] * np.exp(NEAR) < ratio < POSSIBLE[1]:
        return
    if ratio <= 0.0:
        raise ValueError(f"{name} reads {ratio:.3g} times {than}: a meter without a signal, or no water")
    unit = unit_near(quantity, ratio)
    if unit is not None:
        raise ValueError(f"{name} reads {ratio:.3g} times {than}, {said_of(quantity, unit)}")
    if not POSSIBLE[0] < ratio < POSSIBLE[1]:
        raise ValueError(f"{name} reads {ratio:.3g} times {than}: a wrong unit, or the file of another station")


def _check_level(traces: Traces, station: Station) -> None:
    check_level_unit(traces, station)
    usual_m = usual_level_m(traces, station)
    if usual_m is not None and not 1.0 / 6.0 < usual_m / station.middle_level_m < 6.0:
        raise ValueError(
            f"level_m reads {usual_m:.4g} {where_pumps_switch(station)}: "
            "another unit, such as % of a span, or the file of another station"
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
    if traces.value == "held":
        flow_m3h = np.array([filled(values, values.size, 0.0) for values in flow_m3h])
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
