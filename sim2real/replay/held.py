"""Channels that are held within a deadband: the sizes of their moves, and what these tell of it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers

MIN_MOVES, FEWEST = 30, 10
"""Moves from which their sizes are looked at, and from which a channel is held and not stuck."""
SMALL = 0.1
"""Share of the moves that are small."""
HELD_SHARE = 0.15
"""Share of repeated values from which a channel counts as held; noise repeats nothing."""
NEARLY_ALL = 0.9
"""Share from which it counts as held where moves are too few, or too far apart, to have an edge of their sizes."""
DEAD_ZONE = 0.35
"""Small moves over the median one; 0.19 for noise. Small: one in ten is smaller, such as those sent after a time."""
EDGE = 1.5
"""Ratio of the sizes that one move in five and one in ten (or ten and twenty) do not reach; 2 for noise."""
FEW = 0.005
"""Share of moves that may be smaller than the deadband: values that were lost, or sent twice."""
STORED_MOVES = 2.5
"""Steps of storage up to which moves tell of that alone, and of nothing that holds the value."""
OFTEN_S = 60
"""A value that is held for less was not sent because its time was up."""
SEEN_SHARES = (0.97, 1.03)
"""Shares of a deadband that was seen between which it may be: in noise or slow moves."""
IN_RAMPS = (0.1, 1.4)
"""Shares between which a deadband may be that was seen in the steps of ramps, whose smallest may be far over it."""
BY_TIME = (0.6, np.inf)
"""Shares of the largest move of a value whose time was up between which its deadband may be."""
PILE, PILED = 1.25, 0.25
"""Ratio of sizes within which moves from row to row pile up over a deadband, and share of them that does.

Of the moves of noise a ninth lies within it at the most: those of a half normal distribution about one deviation.
"""
OVER_PILE = (0.8, 1.25)
"""Shares of the least of these moves between which the deadband may be."""
HALF_HELD = 0.5
"""Share of repeated values from which a channel is held where its moves from row to row do not pile up."""
REGULAR = 0.75
"""Share of the waits from move to move that are alike where values are read anew at times: no deadband holds them."""
BETWEEN_ROWS = (0.1, np.inf)
"""Shares of the largest move from row to row between which it may be: there may be several moves in one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Held:
    """What the moves of a channel tell of its deadband.

    `within` are the shares of it between which it may be. A held value is not sent again for `pause_s`, however far
    it moves.
    """

    deadband: float
    within: tuple[float, float]
    pause_s: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Moves:
    """Sizes of the moves of a channel, and the share of its values that are held.

    `soon` are those that follow another soon, so were not sent as their time was up, `is_soon_calm` which of these
    are in no ramp, `calm` all that are in none, and `in_ramps` the others. `waits` are the rows from move to move
    while there are values, and `waits_in_ramps` those in ramps, where a value would move each second.
    """

    all: Floats
    soon: Floats
    is_soon_calm: Flags
    calm: Floats
    in_ramps: Floats
    waits: Integers
    waits_in_ramps: Integers
    held_share: float

    @property
    def pause_s(self) -> int:
        """Whole seconds for which a value of each second is held in ramps too."""
        waits = self.waits_in_ramps
        return round(float(np.quantile(waits, FEW))) - 1 if waits.size >= MIN_MOVES else 0


def moves_of(parts: Sequence[Floats], is_ramp: Flags, rate_s: float) -> Moves:
    """Moves of a channel from row to row.

    Parameters
    ----------
    parts : sequence of (rows,) arrays
        Values, each of another pump; NaN is "no value".
    is_ramp : (parts, rows) array
        Whether it starts or stops.
    rate_s : float
        From row to row. [s]
    """
    often = max(OFTEN_S / rate_s, 2.0)
    sizes = [np.abs(np.diff(part)) for part in parts]
    at = [np.flatnonzero(size > 0.0) for size in sizes]
    soon = [its[1:][np.diff(its) < often] for its in at]
    is_calm = [~(ramp[:-1] | ramp[1:]) for ramp in is_ramp]
    moved = np.concatenate([size[its] for size, its in zip(sizes, at, strict=True)])
    is_moved_calm = np.concatenate([calm[its] for calm, its in zip(is_calm, at, strict=True)])
    return Moves(
        all=moved,
        soon=np.concatenate([size[its] for size, its in zip(sizes, soon, strict=True)]),
        is_soon_calm=np.concatenate([calm[its] for calm, its in zip(is_calm, soon, strict=True)]),
        calm=moved[is_moved_calm],
        in_ramps=moved[~is_moved_calm],
        waits=np.concatenate([_waits(part, its) for part, its in zip(parts, at, strict=True)]),
        waits_in_ramps=np.concatenate(
            [np.diff(its)[_within(ramp, its)] for its, ramp in zip(at, is_ramp, strict=True)]
        ),
        held_share=1.0 - moved.size / max(sum(int(np.isfinite(size).sum()) for size in sizes), 1),
    )


def _waits(values: Floats, at: Integers) -> Integers:
    """Rows from move to move without a missing value between them."""
    missing = np.cumsum(~np.isfinite(values))
    return np.asarray(np.diff(at)[missing[at[1:]] == missing[at[:-1]]], dtype=np.int64)


def _within(is_ramp: Flags, at: Integers) -> Flags:
    """Which of the times from move to move lie within one ramp."""
    count = np.r_[0, np.cumsum(is_ramp)]
    return np.asarray(count[at[1:] + 1] - count[at[:-1]] == np.diff(at) + 1)


def held_each_second(moves: Moves, quantum: float) -> Held | None:
    """Deadband of a channel of each second: it lies under the smallest moves that follow another soon.

    A move that is stored in steps of `quantum` may be off by one of them.

    Where such are few, and nearly all values are held, it lies over the largest move outside ramps, which its time
    being up has brought about.
    """
    soon, least = moves.soon, STORED_MOVES * quantum
    if moves.held_share > NEARLY_ALL and soon.size < MIN_MOVES and moves.calm.size >= FEWEST:
        largest = float(moves.calm.max())
        return Held(deadband=largest, within=BY_TIME) if largest > least else None
    if moves.held_share <= HELD_SHARE or moves.all.size < MIN_MOVES or _small(moves) <= least:
        return None
    if not (_has_edge(moves.all) or _has_edge(soon)):
        return None
    if soon.size < MIN_MOVES:
        return Held(deadband=float(np.quantile(moves.all, SMALL)), within=IN_RAMPS)
    deadband = float(np.quantile(soon, FEW))
    if deadband <= least:
        return None
    low, high = SEEN_SHARES if moves.is_soon_calm.sum() >= MIN_MOVES else IN_RAMPS
    rounding = quantum / deadband
    within = (low * (1.0 - rounding), high * (1.0 + rounding))
    return Held(deadband=deadband, within=within, pause_s=moves.pause_s)


def held_between_rows(moves: Moves, quantum: float) -> Held | None:
    """Deadband of a channel whose rows lie apart: there may have been several moves from one to the next.

    Single ones pile up just over the deadband. Where they do not, and most values are held, it lies under the moves
    in ramps, which are of one sign, or else about the largest outside them. What is stored in steps of `quantum`
    moves by a few of them; what is read anew each minute moves each minute.
    """
    least = STORED_MOVES * quantum
    if moves.held_share <= HELD_SHARE or _is_regular(moves.waits):
        return None
    piled = _pile(moves.soon[moves.is_soon_calm])
    if piled > least:
        return Held(deadband=piled, within=OVER_PILE)
    usual = float(np.median(moves.calm)) if moves.calm.size else 0.0
    if moves.held_share <= HALF_HELD or usual < least:
        return None
    if moves.in_ramps.size >= FEWEST:
        return Held(deadband=float(np.quantile(moves.in_ramps, SMALL)), within=IN_RAMPS)
    return Held(deadband=float(moves.calm.max()), within=BETWEEN_ROWS) if moves.calm.size >= FEWEST else None


def as_sent(values: Floats, rate_s: float) -> Floats:
    """(n,) what a held channel sent, at about the second in which it did: rows tell of it later.

    A single move came at any time since the row before, so half of it ago in the mean. Of several the last did, and
    that is as much less as a deadband is of what they moved together. If they tell of no deadband they stay.

    Parameters
    ----------
    values : (n,) array
        NaN between rows.
    rate_s : float
        From row to row. [s]
    """
    known = np.flatnonzero(np.isfinite(values))
    moved = np.diff(values[known])
    held = held_between_rows(moves_of([values[known]], np.zeros((1, known.size), dtype=np.bool_), rate_s), 0.0)
    single = 0.0 if held is None else held.deadband
    is_sent = moved != 0.0
    ago_s = 0.5 * np.diff(known)[is_sent] * np.minimum(single / np.abs(moved[is_sent]), 1.0)
    sent = np.full(values.size, np.nan)
    sent[known[1:][is_sent] - np.rint(ago_s).astype(np.int64)] = values[known[1:][is_sent]]
    return sent


def _small(moves: Moves) -> float:
    """Size of small moves that were not sent because their time was up, as far as they tell."""
    return float(np.quantile(moves.soon if moves.soon.size >= FEWEST else moves.all, SMALL))


def _has_edge(jumps: Floats) -> bool:
    """Whether moves under a size are missing, as under a deadband."""
    if jumps.size < MIN_MOVES:
        return False
    few, smallest, more, middle = (float(q) for q in np.quantile(jumps, [0.05, SMALL, 0.2, 0.5]))
    return smallest > DEAD_ZONE * middle or smallest < EDGE * few or more < EDGE * smallest


def _is_regular(waits: Integers) -> bool:
    """Whether nearly all waits are as many rows as the most, and more than one."""
    count = np.bincount(waits)
    return waits.size >= FEWEST and int(np.argmax(count)) > 1 and float(count.max()) > REGULAR * waits.size


def _pile(sizes: Floats) -> float:
    """The least of the first sizes that pile up within `PILE` of each other; 0 where none do, or there are few.

    Single moves are the first pile, and two or three at once are further ones.
    """
    sizes = np.sort(sizes)
    count = np.searchsorted(sizes, PILE * sizes, side="right") - np.arange(sizes.size)
    piles = np.flatnonzero(count > PILED * sizes.size)
    if sizes.size < MIN_MOVES or piles.size == 0:
        return 0.0
    first = sizes <= PILE * sizes[piles[0]]
    return float(sizes[int(np.argmax(np.where(first, count, 0)))])
