"""The diagnosis: verdict, where the gap lies, which effects cause it, and how far it shrinks with them."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from wetwell.protocols.recording import Recording
from wetwell.protocols.station import EffectTable, Station
from wetwell.sim2real.attribution import Attribution, Attributor
from wetwell.sim2real.bins import LEVEL, SIGNALS, Bins
from wetwell.sim2real.candidates import Freedom, candidates_of
from wetwell.sim2real.culprit import culprit
from wetwell.sim2real.excerpt import excerpt
from wetwell.sim2real.misfit import Misfit
from wetwell.sim2real.plausibility import check_plausible
from wetwell.sim2real.regimes import IDLE, MULTI_PUMP, REGIMES, STEADY, Regimes, regimes_of
from wetwell.sim2real.replay import Replay
from wetwell.sim2real.shrinkage import FLOOR, NOTHING, Interval, Shrinkage, bootstrap, shrinkage_of
from wetwell.sim2real.structure import explained, repeating
from wetwell.sim2real.sureness import is_sure
from wetwell.sim2real.traces import Traces, traces_of
from wetwell.simulator.effects import effects_of
from wetwell.simulator.effects.effect import Component, Effect

Floats = npt.NDArray[np.float64]

Verdict = Literal["effect", "none", "unknown"]
KEPT = 1.0 / 3.0
"""Share of its gap that a signal may keep under the accepted effects."""
KEPT_OF_ONE_FORM = 0.1
"""The same of a signal in one regime, where no accepted effect could have another form that explains the rest."""
HARDLY = 0.3
"""Share of the whole gap that is left when the effects found so far hardly matter."""
SEEN = 0.6
"""Repeating mean square of a signal in one regime, in units of noise, from which it is a gap."""
KEPT_OF_CALM = 0.02
"""The same while nothing is switched, where the strongest effect has one form then: ramps have many."""
CLEAR = 1.0
"""The same where another form of an effect is no excuse."""
LARGE = 4.0
"""Mean square of half of the cycles, in units of noise, that no noise has."""
CALM = {IDLE, STEADY, MULTI_PUMP}
MIN_BINS = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """A cell of the map of the gap: its size (1 is noise), the interval of it, and its share of the whole."""

    component: Component
    signal: str
    regime: str
    gap: float
    ci: Interval
    share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A fitted parameter with its 95 % interval."""

    name: str
    value: float
    ci: Interval
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """An accepted effect; `equivalent` names those that these data cannot tell from it."""

    name: str
    component: Component
    equivalent: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    fixed: dict[str, str | int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """All that is found; `station` has the effects added. `fit` and what it rests on are for drawings."""

    verdict: Verdict
    where: tuple[Place, ...]
    causes: tuple[Cause, ...]
    ranking: tuple[tuple[str, float, float, Interval], ...]
    gap: Shrinkage
    station: Station
    attribution: Attribution
    bins: Bins
    traces: Traces
    regimes: Regimes
    replay: Replay


def diagnose(
    recording: Recording,
    station: Station,
    *,
    only: Iterable[str] | None = None,
    without: Iterable[str] = (),
    seed: int = 0,
    progress: Callable[[float], None] = lambda _: None,
) -> Diagnosis:
    """Diagnose the gap between a station and its recording.

    Parameters
    ----------
    recording : Recording
        Prepared: times rise. Columns of truth are not read.
    station : Station
        What the simulator runs with; its own effects stay.
    only, without : names of effects
        Restrict the library.
    seed : int
        Of the bootstrap.
    progress : callable
        Gets the share of the work that is done.

    Raises
    ------
    ValueError
        If recording and station do not fit, the recording is too short or in other units, or a name is not in the
        library.
    """
    candidates = candidates_of(len(station.pump), only=only, without=without)
    traces = excerpt(traces_of(recording, station))
    regimes = regimes_of(traces, station)
    replay = Replay(traces, station, effects_of(station))
    plain = replay.run()
    check_plausible(traces, station, regimes, plain)
    misfit = Misfit(traces, station, regimes, plain)
    found = Attributor(replay, misfit, candidates, progress).search()
    bins, pumps = misfit.bins, traces.pumps
    rng = np.random.default_rng(seed)
    if shrinkage_of(found.plain, found.plain, bins, found.held, rng).before < FLOOR + NOTHING:
        found = replace(found, accepted=None, equivalent=(), ends=np.zeros((0, 2)))
    before = _repeating_gap(found.plain, bins, found, pumps)
    accepted = found.accepted
    after_residuals = found.plain if accepted is None else accepted.residuals
    after = before if accepted is None else _repeating_gap(after_residuals, bins, found, pumps)
    verdict: Verdict = "none" if accepted is None else "effect"
    told = set(range(len(SIGNALS))) - ({LEVEL} if traces.inflow_m3h is None else set())  # an unknown inflow moves it
    if _is_unexplained(before, after, after_residuals, bins, found, told):
        verdict = "unknown"
    causes = _causes(found)
    where: tuple[Place, ...] = ()
    if verdict == "unknown":
        explains_little = float(after.sum()) > HARDLY * float(before.sum())
        residuals = found.plain if explains_little else after_residuals
        left = np.where(found.held, residuals**2 - bins.floor, 0.0)
        where = _places(residuals, left, bins, found, culprit(left, residuals, bins, plain.plant), rng)
    elif verdict == "effect":
        where = _places(found.plain, before, bins, found, causes[0].component, rng)
    effects = accepted.effects if accepted is not None and verdict == "effect" else ()
    tables = tuple(EffectTable.model_validate(effect.model_dump()) for effect in effects)
    return Diagnosis(
        verdict=verdict,
        where=where,
        causes=causes if verdict == "effect" else (),
        ranking=tuple(_ranking(found, bins, rng)),
        gap=shrinkage_of(found.plain, after_residuals if effects else found.plain, bins, found.held, rng),
        station=station.model_copy(update={"effect": (*station.effect, *tables)}),
        attribution=found,
        bins=bins,
        traces=traces,
        regimes=regimes,
        replay=replay,
    )


def _repeating_gap(residuals: Floats, bins: Bins, found: Attribution, pumps: int) -> Floats:
    """(bins,) what of each square repeats from the fitted cycles to the held ones, so is no noise; 0 elsewhere."""
    expected = repeating(residuals, bins, found.fitted, pumps)
    return np.where(found.held, explained(residuals, expected), 0.0)


def _is_unexplained(
    before: Floats, after: Floats, residuals: Floats, bins: Bins, found: Attribution, told: set[int]
) -> bool:
    """Whether one of the `told` signals keeps a gap that is sure, or large, and more than a third of what it was.

    A tenth, in one regime, where each accepted effect has but one form; a fiftieth, while nothing is switched, where
    the strongest one has one form then.
    """
    swinging = _swinging(bins, found)
    has_one_form = found.accepted is not None and all(effect.has_one_form for effect in found.accepted.effects)
    is_rigid = found.accepted is not None and not found.accepted.effects[0].is_shaped
    excess, plain_excess = residuals**2 - bins.floor, found.plain**2 - bins.floor
    for signal in sorted(told):
        rows = found.held & (bins.signal == signal)
        was = max(float(before[rows].sum()), float(plain_excess[rows].sum()))
        left = float(after[rows].sum())
        is_left = False
        for regime in range(len(REGIMES)):
            cell = rows & (bins.regime == regime)
            if cell.sum() < MIN_BINS:
                continue
            cycles = np.unique(bins.cycle[cell], return_inverse=True)[1]
            is_repeating = float(after[cell].mean()) > SEEN and is_sure(
                np.bincount(cycles, after[cell]).astype(np.float64)
            )
            is_large = (
                signal not in swinging
                and float(np.median(np.bincount(cycles, residuals[cell] ** 2) / np.bincount(cycles))) > LARGE
            )
            if is_large:
                left = max(left, float(excess[rows].sum()))
            is_left |= is_repeating or is_large
            in_cell = excess if is_large else after
            if (is_repeating or is_large) and float(in_cell[cell].mean()) > CLEAR:
                cell_was = max(float(before[cell].sum()), float(plain_excess[cell].sum()))
                share = float(in_cell[cell].sum()) / max(cell_was, 1e-12)
                if has_one_form and share > KEPT_OF_ONE_FORM:
                    return True
                if is_rigid and regime in CALM and share > KEPT_OF_CALM:
                    return True
        if is_left and left > KEPT * was:
            return True
    return False


def _swinging(bins: Bins, found: Attribution) -> set[int]:
    """Signals that an accepted effect lets swing with time: how they swing beyond its form is no news."""
    if found.accepted is None or all(type(effect).force is Effect.force for effect in found.accepted.effects):
        return set()
    gains = np.bincount(bins.signal, found.plain**2 - found.accepted.residuals**2, len(SIGNALS))
    return {int(np.argmax(gains))}


def _places(
    residuals: Floats,
    excess: Floats,
    bins: Bins,
    found: Attribution,
    component: Component,
    rng: np.random.Generator,
) -> tuple[Place, ...]:
    total = float(np.maximum(np.bincount(bins.signal * len(REGIMES) + bins.regime, excess), 0.0).sum())
    places = []
    for signal, signal_name in enumerate(SIGNALS):
        for regime, regime_name in enumerate(REGIMES):
            rows = found.held & (bins.signal == signal) & (bins.regime == regime)
            energy = float(excess[rows].sum())
            if rows.sum() < MIN_BINS or energy <= 0.0:
                continue
            squares = np.sinh(residuals[rows] / 5.0) ** 2 * 25.0 - bins.floor[rows]
            gap, ci = bootstrap(squares, bins.cycle[rows], rng)
            places.append(
                Place(
                    component=component,
                    signal=signal_name,
                    regime=regime_name,
                    gap=gap,
                    ci=ci,
                    share=energy / max(total, 1e-12),
                )
            )
    return tuple(sorted(places, key=lambda place: -place.share))


def _causes(found: Attribution) -> tuple[Cause, ...]:
    if found.accepted is None:
        return ()
    ends = np.split(found.ends, np.cumsum([place.size for place in found.accepted.places])[:-1])
    return tuple(
        Cause(
            name=candidate.name,
            component=candidate.component,
            equivalent=equivalent,
            parameters=tuple(
                _parameter(free, float(share), both)
                for free, share, both in zip(candidate.free, place, interval, strict=True)
            ),
            fixed=dict(candidate.fixed),
        )
        for candidate, place, interval, equivalent in zip(
            found.accepted.candidates, found.accepted.places, ends, found.equivalent, strict=True
        )
    )


def _parameter(free: Freedom, share: float, ends: Floats) -> Parameter:
    low, high = (free.value(float(end)) for end in ends)
    return Parameter(name=free.name, value=free.value(share), ci=(low, high), unit=free.unit)


def _ranking(
    found: Attribution, bins: Bins, rng: np.random.Generator
) -> Iterable[tuple[str, float, float, Interval]]:
    for single in found.singles:
        gap = shrinkage_of(found.plain, single.fit.residuals, bins, found.held, rng)
        yield single.fit.names[0], single.score, gap.shrinkage, gap.shrinkage_ci
