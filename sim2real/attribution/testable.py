"""Which effects a recording can show at all, and why it cannot show the others."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.protocols.quantities import PUMP_METERS, AnalogueQuantity
from wetwell.sim2real.attribution.candidates import Candidate
from wetwell.sim2real.attribution.fitting import Fitter
from wetwell.sim2real.attribution.trials import Each
from wetwell.sim2real.recording.regimes import MULTI_PUMP, Regimes
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.bins import Bins

LEAST_GAIN = 200.0
"""Drop of the sum of squares that a right model may make, however much there is to compare."""
LEAST_BY_CHANCE = 40.0
"""Drop that the library makes of white noise: χ² of four parameters passes it once in ten million fits."""
PROBED = (0.3, 1.0)
"""Strengths that are tried, as shares of the way from neutral to either end of the range."""
CHANGED = 0.01
"""Share of a reading by which an effect changes it."""
CALLED: dict[AnalogueQuantity, str] = {"flow_m3h": "flow", "head_m": "head", "power_kw": "power"}
"""Words for the readings in a reason."""
BESIDE_A_METER = {"unmetered_inflow"}
"""Effects that are what a meter of the inflow does not see: without one there is nothing that they are beside."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NotTested:
    """An effect that a recording cannot show, and why."""

    effect: str
    reason: str


def shown_by(
    candidates: Sequence[Candidate],
    fitter: Fitter,
    replay: Replay,
    regimes: Regimes,
    each: Each,
) -> tuple[tuple[Candidate, ...], tuple[NotTested, ...]]:
    """Candidates that move what is counted by more than noise at some size within their ranges, and the others.

    Parameters
    ----------
    candidates : sequence of Candidate
    fitter : Fitter
        An effect has to move the bins that it fits.
    replay : Replay
    regimes : Regimes
    each : callable
        Tries candidates, perhaps side by side.
    """
    least = _least_gain(fitter.bins, fitter.rows)
    are_moving = list(each(lambda candidate: _moves(candidate, fitter, least, replay), candidates))
    tested = tuple(candidate for candidate, moves in zip(candidates, are_moving, strict=True) if moves)
    names = {candidate.name for candidate in tested}
    hidden = {candidate.name: candidate for candidate in candidates if candidate.name not in names}
    return tested, tuple(
        NotTested(effect=name, reason=_reason(candidate, replay, regimes)) for name, candidate in hidden.items()
    )


def _least_gain(bins: Bins, rows: Flags) -> float:
    """Drop of the sum of squares of some bins that a right model may make: by its tolerance, or by chance."""
    return min(LEAST_GAIN, max(LEAST_BY_CHANCE, float(np.sum(bins.tolerance[rows] ** 2))))


def _moves(candidate: Candidate, fitter: Fitter, least: float, replay: Replay) -> bool:
    if candidate.is_pattern:
        return _rows_show(candidate, replay.traces)
    if candidate.name in BESIDE_A_METER and replay.traces.inflow_m3h is None:
        return False
    plain = fitter.plain.residuals
    for grid in _points(candidate):
        for point in grid:
            tried = fitter.at((candidate,), (point,))
            if tried is not None:
                moved = (tried.residuals - plain)[fitter.rows]
                if float(moved @ moved) > least:
                    return True
    return False


def _rows_show(pattern: Candidate, traces: Traces) -> bool:
    """Whether single values are seen as they came: means hide them, and what stores held values has a deadband."""
    if traces.is_each_second:
        return True
    if pattern.name == "level_quantisation":
        return traces.span_s == 1 and bool(np.isfinite(traces.level_m).any())
    return traces.value == "instant"


def _points(candidate: Candidate) -> list[list[Floats]]:
    return candidate.start_grids({}, PROBED)


def _reason(candidate: Candidate, replay: Replay, regimes: Regimes) -> str:
    """Why an effect is not tested: by what its component needs, else by what it changes."""
    traces = replay.traces
    rows = f"rows of {traces.rate_s:g} s"
    if candidate.component == "controller":
        if replay.station.control.is_external:
            return "the control is external: nobody knows why pumps start and stop"
        return f"{rows} do not show the level at which a pump was switched"
    if candidate.is_pattern:
        return f"{rows} do not show how single values came"
    if candidate.component in {"sump", "level_sensor"} and not np.isfinite(traces.level_m).any():
        return "the level is not measured"
    if candidate.component == "sump" and traces.inflow_m3h is None:
        return "the inflow is not measured: the level follows it, whatever comes"
    return _hidden(_changed(candidate, replay), replay, regimes)


def _hidden(changed: set[AnalogueQuantity], replay: Replay, regimes: Regimes) -> str:
    """Why readings that an effect changes do not show it."""
    traces = replay.traces
    missing = [CALLED[name] for name in PUMP_METERS if name in changed - traces.signals.keys()]
    if missing and not changed & traces.signals.keys():
        return f"{' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} not measured"
    if changed and not traces.is_each_second:
        return f"what it changes is over, or within the noise, in rows of {traces.rate_s:g} s"
    if not np.any(regimes.of_station == MULTI_PUMP):
        return "no two pumps ran at once"
    return "it moves nothing that was measured by more than noise"


def _changed(candidate: Candidate, replay: Replay) -> set[AnalogueQuantity]:
    """Readings of each second that an effect changes, measured or not."""
    plain = replay.readings(())
    found: set[AnalogueQuantity] = set()
    for grid in _points(candidate):
        try:
            tried = replay.readings((candidate.effect(grid[-1]),))
        except ValueError:
            continue
        for name, before, after in zip(PUMP_METERS, plain, tried, strict=True):
            if float(np.max(np.abs(after - before), initial=0.0)) > CHANGED * float(np.max(before, initial=0.0)):
                found.add(name)
    return found
