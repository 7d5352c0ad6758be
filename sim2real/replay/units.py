"""Values in other units than ours: seen by what the station's curves give, before anything is judged."""

from dataclasses import replace

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.recording.excerpt import MOST_DIAGNOSED_S, MOST_OF_ROWS_S
from wetwell.sim2real.recording.regimes import STEADY, regimes_of
from wetwell.sim2real.recording.traces import Traces, traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.simulator.effects import effects_of

UNITS: dict[str, dict[str, float]] = {
    "flow_m3h": {"L/s": 1 / 3.6, "m³/s": 1 / 3600.0, "L/min": 1000.0 / 60.0, "m³/d": 24.0, "US gal/min": 4.4029},
    "head_m": {"bar": 1 / 10.197, "kPa": 9.8067, "cm or mbar": 100.0, "mm": 1000.0},
    "power_kw": {"W": 1000.0, "MW": 0.001},
    "level_m": {"cm": 100.0, "mm": 1000.0},
}
"""Readings in other units over those in ours."""
NEAR = 0.25
"""Deviation from such a factor, in its logarithm, that effects may bring about."""
LIKELY = 0.35
"""Logarithm of a ratio that hardly any effect brings about alone."""
MOSTLY = 0.8
"""Share of steady seconds that are near a factor where a unit is the cause: a fault comes and goes."""
FAST_S = 2.0
"""Rows that are no further apart make a long recording of two days. [s]"""
PERCENT = 0.04
MOST_OVERSPEED = 1.15
"""Speed over the nominal one that no motor holds: by the affinity laws it would give half as much again. [1]"""


def check_units(recording: Recording, station: Station) -> None:
    """Refuse a recording whose values are in other units; where it cannot tell that, it is none.

    The beginning of a long recording is looked at. What a fault may do is not refused: nearly all of what runs
    steadily has to differ by the factor of a unit.

    Parameters
    ----------
    recording : Recording
        Times rise.
    station : Station

    Raises
    ------
    ValueError
        Says quantity, reading, unit and factor, in one line.
    """
    try:
        traces = traces_of(_beginning(recording), station, least_starts=1)
    except ValueError:
        return  # too little of anything to tell
    check_frequency(traces, station)
    check_level_unit(traces, station)
    steady = regimes_of(traces, station).of_pumps == STEADY
    expected = Replay(traces, station, effects_of(station)).run().signals
    for name, recorded in traces.signals.items():
        calm = steady & (recorded > 0.0) & (expected[name] > 0.0)
        unit = _mostly(name, np.log(recorded[calm] / expected[name][calm]))
        if unit is not None:
            ratio = float(np.median(recorded[calm] / expected[name][calm]))
            raise ValueError(f"{name} reads {ratio:.3g} times what this station gives, {said_of(name, unit)}")


def unit_near(name: str, ratio: float) -> str | None:
    """Unit of a quantity by whose factor readings differ from those in ours; None if it is none.

    Examples
    --------
    >>> unit_near("flow_m3h", 0.29), unit_near("flow_m3h", 0.9)
    ('L/s', None)
    """
    return next((unit for unit, factor in UNITS[name].items() if abs(np.log(ratio / factor)) < NEAR), None)


def said_of(name: str, unit: str) -> str:
    """What to do about readings in a unit."""
    return f"as if in {unit}: prepare the recording with a scale of {1.0 / UNITS[name][unit]:.4g}"


def check_frequency(traces: Traces, station: Station) -> None:
    """Refuse frequencies in percent, or as a share of the nominal one, or of pumps with a higher nominal one.

    Raises
    ------
    ValueError
        One line.
    """
    nominal_hz = max(pump.nominal_frequency_hz for pump in station.pump)
    running = traces.frequency_hz[traces.frequency_hz > 0.0]
    usual_hz = float(np.quantile(running, 0.9)) if running.size else nominal_hz
    for full, unit, factor in ((100.0, "% of nominal", nominal_hz / 100.0), (1.0, "a share of nominal", nominal_hz)):
        if abs(usual_hz / full - 1.0) < PERCENT and abs(np.log(usual_hz / nominal_hz)) > LIKELY:
            raise ValueError(
                f"frequency_hz reads {usual_hz:.4g} where nominal is {nominal_hz:g} Hz, as if in {unit}: "
                f"prepare the recording with a scale of {factor:.4g}"
            )
    if usual_hz > MOST_OVERSPEED * nominal_hz:
        raise ValueError(
            f"frequency_hz reads {usual_hz:.4g}, more than {MOST_OVERSPEED:g} times nominal_frequency_hz, which is "
            f"{nominal_hz:g}: set the one of these pumps, with their curves at that speed"
        )


def check_level_unit(traces: Traces, station: Station) -> None:
    """Refuse levels in centimetres or millimetres, by the levels at which pumps switch.

    Raises
    ------
    ValueError
        One line.
    """
    usual_m = usual_level_m(traces, station)
    if usual_m is None:
        return
    for unit, factor in UNITS["level_m"].items():
        if usual_m > 0.0 and abs(np.log(usual_m / station.middle_level_m / factor)) < 2.0 * NEAR:
            raise ValueError(f"level_m reads {usual_m:.4g} {where_pumps_switch(station)}, {said_of('level_m', unit)}")


def usual_level_m(traces: Traces, station: Station) -> float | None:
    """Median of the level; None where there is none, or none to compare it with: no levels drive the station. [m]."""
    level_m = traces.level_m[np.isfinite(traces.level_m)]
    return None if level_m.size == 0 or station.control.is_external else float(np.median(level_m))


def where_pumps_switch(station: Station) -> str:
    """Levels of a station that levels drive, for a line that refuses."""
    control = station.control
    return f"where the pumps switch at {control.stop_levels_m[0]:g} to {control.start_levels_m[0]:g} m"


def _beginning(recording: Recording) -> Recording:
    time_ns = recording.time_ns
    step_s = float(np.median(np.diff(time_ns))) / NS_PER_S if time_ns.size > 1 else 1.0
    most_s = MOST_DIAGNOSED_S if step_s <= FAST_S else MOST_OF_ROWS_S
    rows = slice(0, int(np.searchsorted(time_ns, time_ns[0] + most_s * NS_PER_S)))
    columns = {name: values[rows] for name, values in recording.columns.items()}
    return replace(recording, time_ns=time_ns[rows], columns=columns)


def _mostly(name: AnalogueQuantity, log_ratios: Floats) -> str | None:
    """Unit by whose factor most of the readings differ."""
    if log_ratios.size == 0:
        return None
    unit = unit_near(name, float(np.exp(np.median(log_ratios))))
    if unit is None or np.mean(np.abs(log_ratios - np.log(UNITS[name][unit])) < NEAR) < MOSTLY:
        return None
    return unit
