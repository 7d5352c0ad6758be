"""What the likelihood is of: the mean of the residuals of a group in a cycle."""

from dataclasses import dataclass, replace

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.sim2real.recording.regimes import MULTI_PUMP, REGIMES, START_RAMP, STEADY, STOP_RAMP
from wetwell.sim2real.residuals.bins import LEVEL, Bins, allowed_size
from wetwell.sim2real.residuals.phases import group_of, phase

SPANS = 32
"""More than there are spans since a regime began."""
TIMES = (1.0, 3.0, 10.0, 30.0)
"""How many times what is known a size may be of which nobody knows more: half a decade apart. [1]"""
POORLY = 0.1
"""Probability that a right model is poor in a span or group; that a block is one where it mostly is; that it rains in
a cycle, and that it does not where several pumps run. [1]"""
SURGES = (0.0, *TIMES[:3])
"""Variance that surges of an inflow without a meter add to the level, over what the drift of the inflow at rest makes
of it: rain comes faster than that. In slow rows with a meter, what the rows hide of inflow and switches, over what
the station file makes of it. Each as likely. [1]"""
RAIN = TIMES[3]
"""Variance that rain adds to the level, over what the drift of the inflow at rest makes of it. [1]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Jumps:
    """How an inflow that nobody measures moves: mostly little, and now and then much.

    Attributes
    ----------
    probability : float
        That it jumps in a cell. [1]
    quiet, jumping : float
        Variance of the level where it does not, and where it does, over what it is on average. [1]
    """

    probability: float
    quiet: float
    jumping: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """Cells of one signal in one regime: errors of one block say nothing of those of another.

    Attributes
    ----------
    signal, regime : int
        Indices into `SIGNALS` and `REGIMES`.
    rows : (k,) array
        Which of all cells.
    group, cycle : (k,) arrays
        Numbers from 0 within the block.
    variance, allowed : (k,) arrays
        As of `Cells`.
    of_inflow : (k,) array
        Variance by which surges and rain count: `variance` as it is on average.
    surges : tuple of float
        Variance that surges of the inflow may add, over `of_inflow`; each as likely.
    may_rain : bool
        Whether the inflow may also move much faster in some cycles: nobody measures it.
    may_jump : bool
        Whether the inflow may jump in some cells, too: nothing is switched in them.
    in_storm : (cycles,) array
        Whether several pumps run in a cycle: more comes in than one carries.
    span : (groups,) array
        Span of the time since the regime began, and condition, of each group: numbers from 0; pumps have the same.
    surge : float or (k,) array
        The one that is supposed.
    jumps : Jumps or None
        As they were learnt; None where the inflow does not jump, or may not.
    """

    signal: int
    regime: int
    rows: Integers
    group: Integers
    cycle: Integers
    variance: Floats
    allowed: Floats
    of_inflow: Floats
    surges: tuple[float, ...]
    may_rain: bool
    may_jump: bool
    in_storm: Flags
    span: Integers
    surge: float | Floats = 0.0
    jumps: Jumps | None = None

    def only(self, kept: Flags) -> "Block":
        """Some of its (k,) cells."""
        groups, group = np.unique(self.group[kept], return_inverse=True)
        cycles, cycle = np.unique(self.cycle[kept], return_inverse=True)
        return replace(
            self,
            rows=self.rows[kept],
            group=group,
            cycle=cycle,
            variance=self.variance[kept],
            allowed=self.allowed[kept],
            of_inflow=self.of_inflow[kept],
            in_storm=self.in_storm[cycles],
            span=np.unique(self.span[groups], return_inverse=True)[1],
            surge=np.broadcast_to(self.surge, self.rows.shape)[kept],
        )

    def group_sums(self, values: Floats) -> Floats:
        """(groups, ...) sums of (k, ...) values."""
        return _sums(self.group, values)

    def group_means(self, values: Floats) -> Floats:
        """(groups,) means of (k,) values."""
        return self.group_sums(values) / self.group_sums(np.ones(values.size))

    def cycle_sums(self, values: Floats) -> Floats:
        """(cycles, ...) sums of (k, ...) values."""
        return _sums(self.cycle, values)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cells:
    """Means over the bins of one group in one cycle, in the order of the groups; all in units of the bins' deviation.

    A group is a signal of a pump in a regime and condition, in a span of the time since that began; a block is a
    signal in a regime.

    Attributes
    ----------
    of_bin : (bins,) array
        Cell of each bin.
    counts : (cells,) array
        Bins of each cell.
    group : (cells,) array
        Numbers from 0.
    variance : (cells,) array
        Of the noise of the sensors, and of nothing else.
    allowed : (cells,) array
        Size under which a difference is none: what is material, and what a right model may be off.
    blocks : tuple of Block
        All cells, each in one of them.
    """

    of_bin: Integers
    counts: Floats
    group: Integers
    variance: Floats
    allowed: Floats
    blocks: tuple[Block, ...]

    def means(self, values: Floats) -> Floats:
        """(cells,) means of (bins,) values."""
        return np.asarray(np.bincount(self.of_bin, values, self.counts.size) / self.counts, dtype=np.float64)

    def group_squares(self, values: Floats) -> Floats:
        """(groups,) mean squares of (cells,) values."""
        return np.asarray(np.bincount(self.group, values**2) / np.bincount(self.group), dtype=np.float64)

    def block_squares(self, values: Floats) -> Floats:
        """(cells,) mean squares of (cells,) values in the block of each."""
        squares = np.zeros(values.size)
        for block in self.blocks:
            squares[block.rows] = np.mean(values[block.rows] ** 2)
        return squares


def cells_of(bins: Bins, condition: Integers, *, has_inflow: bool, is_each_second: bool) -> Cells:
    r"""Cells of the bins of a recording.

    $$\sigma^2 = \overline{f} / n, \qquad a^2 = m^2 + 1 - \overline{f}$$

    with the share f of a bin's variance that is noise, which the n bins of a cell average away, the material size m,
    and the rest of that variance, which is what a right model may be off. Several pumps run because it rains, and so
    does one that runs for longer than nearly all others: what an inflow without a meter does to the level then, it
    may do alike in all storms.

    Parameters
    ----------
    bins : Bins
    condition : (bins,) array
        As `conditions_of` makes it: what is in another condition is in another group.
    has_inflow : bool
        Whether the inflow is measured; else nobody knows the noise of the level well.
    is_each_second : bool
        Whether there is a row a second; else rows hide some of what comes in and goes out even so.
    """
    span_of_bin = condition * SPANS + phase(bins)
    key = group_of(bins) * (int(span_of_bin.max(initial=0)) + 1) + span_of_bin
    groups, group_of_bin = np.unique(key, return_inverse=True)
    span = _first(group_of_bin, span_of_bin)
    cycles = int(bins.cycle.max(initial=0)) + 1
    keys, of_bin = np.unique(group_of_bin * cycles + bins.cycle, return_inverse=True)
    group, cycle = keys // cycles, keys % cycles
    signal, regime = (
        np.zeros(groups.size, dtype=np.int64) + of_groups
        for of_groups in (_first(group_of_bin, bins.signal), _first(group_of_bin, bins.regime))
    )
    counts = np.bincount(of_bin).astype(np.float64)
    noise = np.bincount(of_bin, bins.floor) / counts
    variance, allowed = noise / counts, allowed_size(np.bincount(of_bin, bins.material) / counts, noise)
    if not has_inflow:
        is_rare = (np.bincount(group) < POORLY * cycles) & (span < SPANS)  # of what a crew does nobody knows
        in_storms = ((signal == LEVEL) & ((regime == MULTI_PUMP) | (regime == STEADY) & is_rare))[group]
        allowed[in_storms] = np.hypot(allowed, np.sqrt(RAIN * variance))[in_storms]
    in_storm = np.bincount(bins.cycle, bins.regime == MULTI_PUMP) > 0.0
    block_of = (signal * len(REGIMES) + regime)[group]
    blocks = []
    for key in np.unique(block_of):
        rows = np.flatnonzero(block_of == key)
        its_cycles, its_cycle = np.unique(cycle[rows], return_inverse=True)
        is_ramp = int(key) % len(REGIMES) in (START_RAMP, STOP_RAMP)
        is_level = int(key) // len(REGIMES) == LEVEL
        blocks.append(
            Block(
                signal=int(key) // len(REGIMES),
                regime=int(key) % len(REGIMES),
                rows=rows,
                group=np.unique(group[rows], return_inverse=True)[1],
                cycle=its_cycle,
                variance=variance[rows],
                allowed=allowed[rows],
                of_inflow=variance[rows],
                in_storm=in_storm[its_cycles],
                span=np.unique(span[np.unique(group[rows])], return_inverse=True)[1],
                surges=SURGES if is_level and not (has_inflow and is_each_second) else SURGES[:1],
                may_rain=is_level and not has_inflow,
                may_jump=is_level and not has_inflow and not is_ramp,
            )
        )
    return Cells(of_bin=of_bin, counts=counts, group=group, variance=variance, allowed=allowed, blocks=tuple(blocks))


def _first(group: Integers, values: Integers) -> Integers:
    """(groups,) value of the first member of each group."""
    return values[np.unique(group, return_index=True)[1]]


def _sums(number: Integers, values: Floats) -> Floats:
    count = int(number.max(initial=-1)) + 1
    if values.ndim == 1:
        return np.asarray(np.bincount(number, values, count), dtype=np.float64)
    return np.array([np.bincount(number, column, count) for column in values.T]).T
