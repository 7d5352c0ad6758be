"""Where the search for some parameters begins: what the recording shows directly."""

from collections.abc import Collection, Sequence

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.attribution.candidates import Candidate
from wetwell.sim2real.recording.regimes import MULTI_PUMP, STEADY
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.bins import POWER, Bins
from wetwell.sim2real.residuals.signals import ZERO_SHARE
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.sim2real.residuals.telemetry import Pattern
from wetwell.simulator.parameters import plant_parameters
from wetwell.simulator.power import loaded_power_kw

LONGEST_DELAY_S = 100
"""The longest delay that the library knows. [s]"""
DAY_S = 86_400.0
LONGEST_S = 50_000.0
SHORTEST_S = 45.0
GRID_S = 20.0
FULL = 0.98
REFERENCES = (0.0, 1.0, 3.0, 8.0)
"""Levels at which a lift may be right, in middles between the first start and stop."""
CUTOFFS = (1.04, 0.98, 0.85, 0.7, 0.5, 0.35)
"""Limits that are tried, in least flows that are not 0: a meter may show a flow again only a little over its limit,
and a ramp may pass what is between within a second."""
KNEES = (0.1, 0.3, 0.6)
"""Shares of a ramp at which the first of two slopes may end."""
AHEAD = 0.5
"""Share of what is left there that it does as well: a power law or an S is a poor start for two slopes."""
BENCH = 8.0
"""Exponent of a sump's area with a bench."""
EDGES = (0.25, 0.5, 0.75)
"""Heights of a bench's edge, as shares of the way from the first stop to the first start."""
FINER = 4
"""Frequencies between two that the length of the recording tells apart."""


def initial_guesses(
    candidate: Candidate, replay: Replay, residuals: StationResiduals, plain: Floats
) -> list[dict[str, float]]:
    """Sets of start values by parameter: what of deadbands, quanta, limits and swings the recording shows.

    There is none for a deadband or a quantum where the values have no such pattern.
    """
    names, channel = {free.name for free in candidate.free}, dict(candidate.fixed).get("channel")
    guess = _seen(names, channel, residuals.telemetry.patterns)
    if candidate.is_pattern and not guess:
        return []
    middle_m = replay.station.middle_level_m
    guess |= {name: middle_m for name in ("reference_level_m", "height_m") if name in names}
    if "rated_factor" in names and "power_kw" in replay.traces.signals:
        guess["rated_factor"] = _rated_factor(replay)
    if "delay_s" in names and channel is not None and replay.traces.is_each_second:
        guess |= _late(channel, replay)
    if "fast_period_s" in names:
        guess |= _swing(residuals.bins, replay.traces.time_s, plain)
    return _forms(candidate, guess, replay)


def _forms(candidate: Candidate, guess: dict[str, float], replay: Replay) -> list[dict[str, float]]:
    """A guess in each of the forms that no slope leads to from another one."""
    names = {free.name for free in candidate.free}
    control, middle_m = replay.station.control, replay.station.middle_level_m
    if "cutoff_m3h" in names and "flow_m3h" in replay.traces.signals:
        flow_m3h = replay.traces.signals["flow_m3h"]
        least_m3h = float(np.min(flow_m3h[flow_m3h > ZERO_SHARE * np.nanmax(flow_m3h)], initial=np.inf))
        return [guess | {"cutoff_m3h": share * least_m3h} for share in CUTOFFS if np.isfinite(least_m3h)] or [guess]
    for free in candidate.free:
        if free.forms:
            return [guess | {free.name: form} for form in free.forms]
    if "knee" in names:
        straight = {free.name: free.neutral for free in candidate.free if free.neutral is not None}
        return [guess, *(straight | {"ahead": AHEAD, "knee": knee} for knee in KNEES)]
    if "reference_level_m" in names:
        return [guess | {"reference_level_m": far * middle_m} for far in REFERENCES]
    if "exponent" in names:
        if control.is_external:
            known_m = replay.traces.level_m[np.isfinite(replay.traces.level_m)]
            low_m, high_m = float(known_m.min(initial=middle_m)), float(known_m.max(initial=middle_m))
        else:
            low_m, high_m = control.stop_levels_m[0], control.start_levels_m[0]
        bench = {"exponent": BENCH, "top_factor": 1.0}
        edges_m = [low_m + share * (high_m - low_m) for share in EDGES]
        return [guess, *(guess | bench | {"height_m": edge_m} for edge_m in edges_m)]
    return [guess]


def _seen(names: Collection[str], channel: object, patterns: Sequence[Pattern]) -> dict[str, float]:
    """Deadband or quantum of the patterns of the telemetry."""
    guess: dict[str, float] = {}
    for pattern in patterns:
        if "deadband" in names and pattern.deadband > 0.0 and channel == pattern.quantity:
            guess["deadband"] = pattern.deadband
        if "quantum_m" in names and pattern.quantum > 0.0:
            guess["quantum_m"] = pattern.quantum
    return guess


def _late(channel: str, replay: Replay) -> dict[str, float]:
    """Delay of a signal of the pumps against what is expected; all come early where their frequency is late."""
    recorded, expected = replay.traces.signals, replay.run().signals
    if channel in recorded:
        delay_s = _delay_s(recorded[channel], expected[channel])
    elif channel == "frequency_hz" and recorded:
        first = next(iter(recorded))
        delay_s = _delay_s(expected[first], recorded[first])
    else:
        delay_s = 0.0
    return {"delay_s": delay_s} if delay_s > 0.0 else {}


def _delay_s(recorded: Floats, expected: Floats) -> float:
    """Whole seconds after which (pumps, n) values move most as they are expected to. [s]."""
    alike = np.zeros(LONGEST_DELAY_S + 1)
    for values, its in zip(recorded, expected, strict=True):
        moved, expected_to = (np.nan_to_num(np.diff(each)) for each in (values, its))
        alike += [float(moved[delay:] @ expected_to[: moved.size - delay]) for delay in range(alike.size)]
    return float(np.argmax(alike))


def _rated_factor(replay: Replay) -> float:
    """Recorded power at nominal speed over that of the load by the configured efficiencies."""
    plant = plant_parameters(replay.station)
    shaft_kw = float(np.mean([pump.rated_shaft_kw for pump in plant.pumps]))
    loaded_kw = loaded_power_kw(shaft_kw, shaft_kw, plant.motor_efficiency, plant.drive_efficiency)
    is_full = replay.traces.frequency_hz > FULL * plant.nominal_frequency_hz[:, None]
    seen_kw = replay.traces.signals["power_kw"][is_full]
    return float(np.nanmedian(seen_kw)) / loaded_kw if np.isfinite(seen_kw).any() else 1.0


def _swing(bins: Bins, second_s: Floats, residuals: Floats) -> dict[str, float]:
    """Period and phase of the strongest sine in the steady residuals of the power; its amplitude is small."""
    rows = (bins.signal == POWER) & ((bins.regime == STEADY) | (bins.regime == MULTI_PUMP))
    if rows.sum() < 50:
        return {}
    time_s = second_s[bins.second[rows]]
    values = residuals[rows] * bins.deviation[rows]
    day = 2.0 * np.pi * time_s / DAY_S
    slow = np.column_stack([np.ones(time_s.size), np.cos(day), np.sin(day)])
    daily = np.linalg.lstsq(slow, values, rcond=None)[0]
    values = values - slow @ daily
    phase_h = float(np.arctan2(daily[2], daily[1]) / (2.0 * np.pi) * 24.0 % 24.0)
    place = (time_s / GRID_S).astype(np.int64)
    grid = np.bincount(place, values)
    frequency_hz = np.fft.rfftfreq(FINER * grid.size, GRID_S)
    power = np.abs(np.fft.rfft(grid, FINER * grid.size))
    power[(frequency_hz < 1.0 / LONGEST_S) | (frequency_hz > 1.0 / SHORTEST_S)] = 0.0
    best = 2.0 * np.pi * float(frequency_hz[int(np.argmax(power))])
    if best == 0.0:
        return {}
    wave = np.column_stack([np.sin(best * time_s), np.cos(best * time_s)])
    a, b = np.linalg.lstsq(wave, values, rcond=None)[0]
    phase_s = (-np.arctan2(b, a) / best) % (2.0 * np.pi / best)
    return {
        "fast_period_s": 2.0 * np.pi / best,
        "fast_phase_s": float(phase_s),
        "fast_amplitude": 0.002,
        "daily_phase_h": phase_h,
    }
