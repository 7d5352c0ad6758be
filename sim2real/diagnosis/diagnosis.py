"""The diagnosis: verdict, where the gap lies, which effects cause it, and how far it shrinks with them."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import EffectTable, Station
from wetwell.sim2real.attribution.attribution import KEPT, MIN_BINS, Attribution, Attributor, Each
from wetwell.sim2real.attribution.candidates import Freedom, candidates_of
from wetwell.sim2real.attribution.significance import is_sure
from wetwell.sim2real.diagnosis.localisation import culprit
from wetwell.sim2real.diagnosis.shrinkage import FLOOR, NOTHING, Interval, Shrinkage, bootstrap, gaps_of, shrinkage_of
from wetwell.sim2real.recording.excerpt import excerpt
from wetwell.sim2real.recording.plausibility import check_plausible
from wetwell.sim2real.recording.regimes import IDLE, MULTI_PUMP, REGIMES, STEADY, Regimes, regimes_of
from wetwell.sim2real.recording.traces import Traces, traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.bins import LEVEL, SIGNALS, Bins
from wetwell.sim2real.residuals.residuals import Misfit
from wetwell.sim2real.residuals.structure import explained, repeating
from wetwell.simulator.effects import effects_of
from wetwell.simulator.effects.effect import Component, Effect

Verdict = Literal["effect", "none", "unknown"]
KEPT_OF_ONE_FORM = 0.1
"""The same of a signal in one regime, where no accepted effect could have another form that explains the rest."""
SEEN = 0.6
"""Repeating mean square of a signal in one regime, in units of noise, from which it is a gap."""
KEPT_OF_CALM = 0.02
"""The same while nothing is switched, where the strongest effect has one form then: ramps have many."""
CLEAR = 1.0
"""The same where another form of an effect is no excuse."""
LARGE = 4.0
"""Mean square of half of the cycles, in units of noise, that no noise has."""
CALM = {IDLE, STEADY, MULTI_PUMP}
LEFT = 1.5
"""Mean square beyond noise, in units of it, from which a cell is not closed by the accepted effects."""
LEFT_OF_CALM = (0.06, 0.4)
"""Share of its gap from which that speaks against them while nothing is switched: of fixed and of free forms."""
LEFT_OF_RAMP = 0.2
"""The same in ramps, which have many forms."""
CARRYING = 0.1
"""Share of the whole gap from which a cell is what the effects were accepted for."""
MADE = 2.0
"""Growth of the mean square of a cell that only wrong effects bring about, in units of noise."""
MADE_SHARE = 0.03
"""The same as a share of the whole gap."""
MINOR = 0.01
"""Share of the whole gap under which a cell, or a signal, says nothing against effects that explain the rest."""
UNCLOSED, UNCLOSED_SHARE = 0.1, 0.05
"""What of the gap accepted effects may leave, in units of noise and as a share: who leaves more is no cause."""
LITTLE = 0.3
"""Shrinkage under which an effect is none."""
SLOW_S = 1800
"""Time over which fast swings of a supply are forgotten."""


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
    each: Each = map,
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
    each : callable
        As `map`; that of a pool of threads tries effects side by side.

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
    found = Attributor(replay, misfit, candidates, progress, each).search()
    bins, pumps = misfit.bins, traces.pumps
    rng = np.random.default_rng(seed)
    accepted_residuals = found.plain if found.accepted is None else found.accepted.residuals
    gap = shrinkage_of(found.plain, accepted_residuals, bins, found.held, np.random.default_rng(seed))
    if gap.before < FLOOR + NOTHING or gap.shrinkage < LITTLE:
        found = replace(found, accepted=None, equivalent=(), ends=np.zeros((0, 2)))
    before = _repeating_gap(found.plain, bins, found, pumps)
    accepted = found.accepted
    after_residuals = found.plain if accepted is None else accepted.residuals
    after = before if accepted is None else _repeating_gap(after_residuals, bins, found, pumps)
    verdict: Verdict = "none" if accepted is None else "effect"
    told = set(range(len(SIGNALS))) - ({LEVEL} if traces.inflow_m3h is None else set())  # an unknown inflow moves it
    if (
        _is_wide(bins, found, told)
        or _is_unexplained(before, after, after_residuals, bins, found, told)
        or _is_unclosed(bins, found, told)
    ):
        verdict = "unknown"
    elif accepted is not None and not any(effect.is_seen(plain.plant) for effect in accepted.effects):
        verdict = "none"
    causes = _causes(found)
    where: tuple[Place, ...] = ()
    if verdict == "unknown":
        excess = np.where(found.held, found.plain**2 - bins.floor, 0.0)
        where = _places(found.plain, excess, bins, found, culprit(excess, found.plain, bins, plain.plant), rng)
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
    least = MINOR * float(np.maximum(plain_excess[found.held], 0.0).sum()) if found.accepted is not None else 0.0
    for signal in sorted(told):
        rows = found.held & (bins.signal == signal)
        was = max(float(before[rows].sum()), float(plain_excess[rows].sum()))
        if max(was, float(excess[rows].sum())) < least:
            continue
        left = float(after[rows].sum())
        is_left = False
        for regime in range(len(REGIMES)):
            cell = rows & (bins.regime == regime)
            if cell.sum() < MIN_BINS or max(float(plain_excess[cell].sum()), float(excess[cell].sum())) < least:
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


def _is_wide(bins: Bins, found: Attribution, told: set[int]) -> bool:
    """Whether accepted effects leave too much of the whole gap in the `told` signals, but for excused transients."""
    rows = found.held & np.isin(bins.signal, sorted(told))
    if found.accepted is None or not rows.any():
        return False
    before, after = gaps_of(found.plain, found.left, bins, rows)
    return after - FLOOR > max(UNCLOSED, UNCLOSED_SHARE * (before - FLOOR))


def _is_unclosed(bins: Bins, found: Attribution, told: set[int]) -> bool:
    """Whether accepted effects leave or make a gap in a cell that no form of them does, though it may not repeat."""
    if found.accepted is None:
        return False
    excess, plain_excess = found.left**2 - bins.floor, found.plain**2 - bins.floor
    total = float(np.maximum(plain_excess[found.held], 0.0).sum())
    swinging = _swinging(bins, found)
    limit = LEFT_OF_CALM[found.accepted.effects[0].is_shaped]
    for signal in sorted(told):
        for regime in range(len(REGIMES)):
            cell = found.held & (bins.signal == signal) & (bins.regime == regime)
            count = int(cell.sum())
            if count < MIN_BINS or not _is_left(excess[cell], bins.cycle[cell]):
                continue
            left, was = float(excess[cell].sum()), float(plain_excess[cell].sum())
            if left - was > max(MADE * count, MADE_SHARE * total):
                return True
            if signal in swinging:
                slow = _slow_square(found.left[cell], bins.second[cell], bins.cycle[cell])
                if slow > LEFT and slow * count > LEFT_OF_CALM[0] * was:
                    return True
            elif was > CARRYING * total and left > (limit if regime in CALM else LEFT_OF_RAMP) * was:
                return True
    return False


def _is_left(excess: Floats, cycle: Integers) -> bool:
    """Whether what is beyond noise is large on average, whichever cycles there are."""
    of_cycle = np.unique(cycle, return_inverse=True)[1]
    sums, counts = np.bincount(of_cycle, excess), np.bincount(of_cycle)
    mean = float(excess.mean())
    error = float(np.sqrt(np.sum((sums - mean * counts) ** 2))) / excess.size
    return mean > LEFT and mean - 2.0 * error > 0.5 * LEFT


def _slow_square(residuals: Floats, second: Integers, cycle: Integers) -> float:
    """Mean product of the means of cycles that are `SLOW_S` apart: what of the square is slower than that."""
    of_cycle = np.unique(cycle, return_inverse=True)[1]
    counts = np.bincount(of_cycle)
    means, times_s = np.bincount(of_cycle, residuals) / counts, np.bincount(of_cycle, second) / counts
    later = np.searchsorted(times_s, times_s + SLOW_S)
    known = later < means.size
    return float(np.mean(means[known] * means[later[known]])) if known.any() else 0.0


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
