"""The rules of the verdict: whether the accepted effects explain the gap, or there is one that no effect explains."""

from typing import Literal

import numpy as np

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.attribution.attribution import Attribution
from wetwell.sim2real.attribution.gains import KEPT
from wetwell.sim2real.attribution.significance import is_significant
from wetwell.sim2real.diagnosis.shrinkage import FLOOR, gaps_of
from wetwell.sim2real.recording.regimes import IDLE, MULTI_PUMP, STEADY
from wetwell.sim2real.residuals.bins import SIGNALS, Bins
from wetwell.sim2real.residuals.groups import groups_of
from wetwell.sim2real.residuals.structure import repeating_squares
from wetwell.simulator.effects.effect import Effect
from wetwell.simulator.parameters import PlantParameters

Verdict = Literal["effect", "none", "unknown"]
CALM = {IDLE, STEADY, MULTI_PUMP}
"""Regimes in which nothing is switched."""
KEPT_OF_ONE_FORM = 0.1
"""Share that a cell may keep where no accepted effect could have another form that explains the rest."""
KEPT_OF_CALM = 0.02
"""Share that a calm cell may keep where the strongest effect has one form then: ramps have many."""
REPEATING_SQUARE = 0.6
"""Repeating mean square of a cell, in units of noise, from which it is a gap."""
ONE_FORM_SQUARE = 1.0
"""Mean square of a cell that speaks against effects where another form of them is no excuse."""
LARGE = 4.0
"""Mean square of half of the cycles, in units of noise, that no noise has."""
LEFT = 1.5
"""Mean square beyond noise, in units of it, from which a cell is not closed by the accepted effects."""
LEFT_OF_CALM = (0.06, 0.4)
"""Share of its gap from which what a calm cell keeps speaks against them: of fixed and of free forms."""
LEFT_OF_RAMP = 0.2
"""Share of its gap from which what a cell in ramps keeps speaks against them: ramps have many forms."""
CARRYING = 0.1
"""Share of the whole gap from which a cell is what the effects were accepted for."""
MADE = 2.0
"""Growth of the mean square of a cell that only wrong effects bring about, in units of noise."""
MADE_SHARE = 0.03
"""Growth of the sum of squares of a cell that only they bring about, as a share of the whole gap."""
MINOR = 0.01
"""Share of the whole gap under which a cell, or a signal, says nothing against effects that explain the rest."""
UNCLOSED, UNCLOSED_SHARE = 0.1, 0.05
"""What of the gap accepted effects may leave, in units of noise and as a share: who leaves more is no cause."""
SLOW_S = 1800
"""Time over which fast swings of a supply are forgotten."""


def verdict_of(found: Attribution, bins: Bins, pumps: int, told: set[int], plant: PlantParameters) -> Verdict:
    """Verdict on an attribution.

    Parameters
    ----------
    found : Attribution
    bins : Bins
    pumps : int
    told : set of int
        Signals that may speak against effects: not the level where its inflow is unknown.
    plant : PlantParameters
        Of the station as it is.
    """
    if _is_wide(bins, found, told) or _is_unexplained(bins, found, told, pumps) or _is_unclosed(bins, found, told):
        return "unknown"
    if found.accepted is None or not any(effect.is_seen(plant) for effect in found.accepted.effects):
        return "none"
    return "effect"


def repeating_gap(residuals: Floats, bins: Bins, found: Attribution, pumps: int) -> Floats:
    """(bins,) what of each square repeats from the training to the validation, so is no noise; 0 elsewhere."""
    return np.where(found.validation, repeating_squares(residuals, bins, found.training, pumps), 0.0)


def _is_wide(bins: Bins, found: Attribution, told: set[int]) -> bool:
    """Whether accepted effects leave too much of the whole gap in the `told` signals, but for excused transients."""
    rows = found.validation & np.isin(bins.signal, sorted(told))
    if found.accepted is None or not rows.any():
        return False
    before, after = gaps_of(found.plain, found.left, bins, rows)
    return after - FLOOR > max(UNCLOSED, UNCLOSED_SHARE * (before - FLOOR))


def _is_unexplained(bins: Bins, found: Attribution, told: set[int], pumps: int) -> bool:
    """Whether one of the `told` signals keeps a gap that repeats, or is large, and more than a third of what it was.

    A tenth, in one regime, where each accepted effect has but one form; a fiftieth, while nothing is switched, where
    the strongest one has one form then.
    """
    swinging = _swinging(bins, found)
    effects = () if found.accepted is None else found.accepted.effects
    most_kept = KEPT_OF_ONE_FORM if effects and all(effect.has_one_form for effect in effects) else np.inf
    most_kept_calm = KEPT_OF_CALM if effects and not effects[0].is_shaped else most_kept
    before, after = (repeating_gap(residuals, bins, found, pumps) for residuals in (found.plain, found.after))
    squares = found.after**2
    excess, plain_excess = squares - bins.floor, found.plain**2 - bins.floor
    least = MINOR * _total(plain_excess, found.validation) if effects else 0.0
    for signal in sorted(told):
        rows = found.validation & (bins.signal == signal)
        was = max(_sum(before, rows), _sum(plain_excess, rows))
        if max(was, _sum(excess, rows)) < least:
            continue
        left, is_left = _sum(after, rows), False
        for _, regime, cell in bins.cells(rows, (signal,)):
            if max(_sum(plain_excess, cell), _sum(excess, cell)) < least:
                continue
            cycles = groups_of(bins.cycle, cell)
            is_repeating = float(after[cell].mean()) > REPEATING_SQUARE and is_significant(cycles.sums(after))
            is_large = signal not in swinging and float(np.median(cycles.means(squares))) > LARGE
            if not (is_repeating or is_large):
                continue
            is_left = True
            kept = excess if is_large else after
            left = max(left, _sum(excess, rows)) if is_large else left
            share = _sum(kept, cell) / max(_sum(before, cell), _sum(plain_excess, cell), 1e-12)
            most = most_kept_calm if regime in CALM else most_kept
            if float(kept[cell].mean()) > ONE_FORM_SQUARE and share > most:
                return True
        if is_left and left > KEPT * was:
            return True
    return False


def _is_unclosed(bins: Bins, found: Attribution, told: set[int]) -> bool:
    """Whether accepted effects leave or make a gap in a cell that no form of them does, though it may not repeat."""
    if found.accepted is None:
        return False
    excess, plain_excess = found.left**2 - bins.floor, found.plain**2 - bins.floor
    total = _total(plain_excess, found.validation)
    swinging = _swinging(bins, found)
    most_calm = LEFT_OF_CALM[found.accepted.effects[0].is_shaped]
    for signal, regime, cell in bins.cells(found.validation, sorted(told)):
        if not _is_left(excess, bins, cell):
            continue
        count, left, was = int(cell.sum()), _sum(excess, cell), _sum(plain_excess, cell)
        if left - was > max(MADE * count, MADE_SHARE * total):
            return True
        if signal in swinging:
            slow = _slow_square(found.left, bins, cell)
            if slow > LEFT and slow * count > LEFT_OF_CALM[0] * was:
                return True
        elif was > CARRYING * total and left > (most_calm if regime in CALM else LEFT_OF_RAMP) * was:
            return True
    return False


def _is_left(excess: Floats, bins: Bins, cell: Flags) -> bool:
    """Whether what is beyond noise is large on average, whichever cycles there are."""
    cycles = groups_of(bins.cycle, cell)
    mean = float(excess[cell].mean())
    error = float(np.sqrt(np.sum((cycles.sums(excess) - mean * cycles.counts) ** 2))) / cycles.number.size
    return mean > LEFT and mean - 2.0 * error > 0.5 * LEFT


def _slow_square(residuals: Floats, bins: Bins, cell: Flags) -> float:
    """Mean product of the means of cycles that are `SLOW_S` apart: what of the square is slower than that."""
    cycles = groups_of(bins.cycle, cell)
    means, times_s = cycles.means(residuals), cycles.means(bins.second.astype(np.float64))
    later = np.searchsorted(times_s, times_s + SLOW_S)
    known = later < means.size
    return float(np.mean(means[known] * means[later[known]])) if known.any() else 0.0


def _swinging(bins: Bins, found: Attribution) -> set[int]:
    """Signals that an accepted effect lets swing with time: how they swing beyond its form is no news."""
    if found.accepted is None or all(type(effect).force is Effect.force for effect in found.accepted.effects):
        return set()
    gains = np.bincount(bins.signal, found.plain**2 - found.accepted.residuals**2, len(SIGNALS))
    return {int(np.argmax(gains))}


def _sum(values: Floats, rows: Flags) -> float:
    return float(values[rows].sum())


def _total(excess: Floats, rows: Flags) -> float:
    """The whole gap: what cells have beyond noise."""
    return float(np.maximum(excess[rows], 0.0).sum())
