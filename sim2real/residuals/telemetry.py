"""Residuals of the telemetry itself: values that are held, values that lie on a lattice."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.protocols.station.station_file import Sensors, Station
from wetwell.sim2real.recording.regimes import START_RAMP, STEADY, STOP_RAMP, Regimes
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.lattice import lattice
from wetwell.sim2real.replay.replay import Prediction
from wetwell.sim2real.residuals.bins import NO_PUMP, TELEMETRY, Bins
from wetwell.sim2real.residuals.noise import configured_noise
from wetwell.sim2real.residuals.phases import PHASES_S
from wetwell.simulator.telemetry.channels import channels_of

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
MIN_QUANTUM_M = 0.0015
USUAL_STEP_M = 0.0101
"""Historians store a level to the millimetre or the centimetre: nobody's fault. [m]"""
STRENGTH = 12.0
"""Residual of a pattern, in each cycle, that an effect leaves unexplained."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pattern:
    """A channel that is held within a deadband, or lies on a lattice of a quantum; in its unit, 0 for neither.

    `within` are the shares of it between which it may be. A held value is not sent again for `pause_s`, however far
    it moves.
    """

    quantity: AnalogueQuantity
    deadband: float = 0.0
    quantum: float = 0.0
    pause_s: int = 0
    within: tuple[float, float] = (1.0, 1.0)

    @property
    def effect(self) -> str:
        """Name of the effect that alone makes values like these."""
        return "report_by_exception" if self.deadband > 0.0 else "level_quantisation"

    @property
    def is_usual(self) -> bool:
        """Whether values are just stored in steps that are usual: that is no gap of the model."""
        return self.deadband == 0.0 and self.quantum <= USUAL_STEP_M

    def rounding(self, acting: float) -> float:
        """Step of the values that is excused: a usual one in any case, else as much of it as acts."""
        return self.quantum if self.is_usual else min(acting, self.quantum)

    def missed(self, acting: float) -> float:
        """Share by which what acts is beyond the ends of where the pattern may be."""
        low, high = (share * max(self.deadband, self.quantum) for share in self.within)
        return max(1.0 - acting / low, acting / high - 1.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class TelemetryResiduals:
    """One residual a cycle for each pattern that is no usual rounding; `patterns` holds those too.

    Each pattern has a span of its own in the cycles, and so is in a group of its own: the deadband of one channel
    explains no other pattern.
    """

    bins: Bins
    patterns: tuple[Pattern, ...]
    cycles: int

    @property
    def effects(self) -> set[str]:
        """Names of the effects of the patterns that count."""
        return {pattern.effect for pattern in _told(self.patterns)}

    def of(self, prediction: Prediction) -> Floats:
        """(patterns that count * cycles,) nothing where the plant holds or rounds so, else `STRENGTH`."""
        sensors = prediction.plant.sensors
        pumps = len(prediction.plant.pumps)
        left = []
        for pattern in _told(self.patterns):
            sensor = sensors[channels_of(pattern.quantity, pumps)[0]]
            acting = sensor.deadband if pattern.deadband > 0.0 else sensor.quantum
            left.append(STRENGTH * min(pattern.missed(acting) / 0.3, 1.0))
        return np.repeat(np.array(left), self.cycles)


def telemetry_residuals(traces: Traces, station: Station, regimes: Regimes) -> TelemetryResiduals:
    """Patterns of all channels that carry noise; a recording without noise shows none."""
    patterns = tuple(_patterns(traces, station.sensors, regimes))
    since_s = np.r_[0, PHASES_S + 1][: len(_told(patterns))]
    count = since_s.size
    cycle, first = np.unique(regimes.cycle, return_index=True)
    is_long = np.diff(first, append=regimes.cycle.size) > since_s.max(initial=0)
    cycle, first = cycle[is_long], first[is_long]
    return TelemetryResiduals(
        bins=Bins(
            signal=np.full(cycle.size * count, TELEMETRY),
            regime=np.full(cycle.size * count, STEADY),
            cycle=np.tile(cycle, count),
            pump=np.full(cycle.size * count, NO_PUMP),
            second=(since_s[:, None] + first).ravel(),
            deviation=np.ones(cycle.size * count),
            floor=np.zeros(cycle.size * count),
            tolerance=np.zeros(cycle.size * count),
            material=np.ones(cycle.size * count),
        ),
        patterns=patterns,
        cycles=cycle.size,
    )


def _told(patterns: tuple[Pattern, ...]) -> list[Pattern]:
    return [pattern for pattern in patterns if not pattern.is_usual]


def _patterns(traces: Traces, sensors: Sensors, regimes: Regimes) -> list[Pattern]:
    if not traces.is_each_second or traces.value == "held":
        return _patterns_of_rows(traces)
    running = traces.frequency_hz > 0.0
    found = []
    series: list[tuple[AnalogueQuantity, list[Floats]]] = [("level_m", [traces.level_m])]
    if traces.inflow_m3h is not None:
        series.append(("inflow_m3h", [traces.inflow_m3h]))
    for name, values in traces.signals.items():
        series.append((name, [np.where(running[i], values[i], np.nan) for i in range(traces.pumps)]))
    noise = configured_noise(sensors)
    for quantity, parts in series:
        is_ramp = np.isin(regimes.of_pumps, (START_RAMP, STOP_RAMP)) & (quantity in traces.signals)
        if noise[quantity] <= 0.0:
            continue
        moves = _moves(parts, is_ramp)
        if moves.all.size < FEWEST:
            continue
        quantum = lattice(np.concatenate(parts))
        if quantity == "level_m" and quantum >= MIN_QUANTUM_M and moves.all.size >= MIN_MOVES:
            found.append(Pattern(quantity=quantity, quantum=quantum))
        if moves.held_share > HELD_SHARE:
            pattern = _held(quantity, moves, quantum)
            found += [pattern] if pattern is not None else []
    return found


def _patterns_of_rows(traces: Traces) -> list[Pattern]:
    """Lattice of the level; rows tell of no deadband, since what is held for less than one is not repeated."""
    quantum = lattice(traces.level_m[traces.is_row]) if np.isfinite(traces.level_m).any() else 0.0
    is_rounded = quantum >= MIN_QUANTUM_M and traces.span_s == 1
    return [Pattern(quantity="level_m", quantum=quantum)] if is_rounded else []


@dataclass(frozen=True, slots=True, kw_only=True)
class _Moves:
    """Sizes of the moves of a channel, and the share of its values that are held.

    `soon` are those that follow another soon, so were not sent as their time was up, `is_soon_calm` which of these
    are in no ramp, and `calm` all that are in none. `waits_s` is the time from move to move in ramps, where a value
    would move each second.
    """

    all: Floats
    soon: Floats
    is_soon_calm: Flags
    calm: Floats
    waits_s: Integers
    held_share: float

    @property
    def pause_s(self) -> int:
        """Whole seconds for which a value is held in ramps too."""
        return round(float(np.quantile(self.waits_s, FEW))) - 1 if self.waits_s.size >= MIN_MOVES else 0


def _moves(parts: list[Floats], is_ramp: Flags) -> _Moves:
    sizes = [np.abs(np.diff(part)) for part in parts]
    at_s = [np.flatnonzero(size > 0.0) for size in sizes]
    soon_s = [at[1:][np.diff(at) < OFTEN_S] for at in at_s]
    is_calm = [~(ramp[:-1] | ramp[1:]) for ramp in is_ramp]
    moved = np.concatenate([size[at] for size, at in zip(sizes, at_s, strict=True)])
    return _Moves(
        all=moved,
        soon=np.concatenate([size[at] for size, at in zip(sizes, soon_s, strict=True)]),
        is_soon_calm=np.concatenate([calm[at] for calm, at in zip(is_calm, soon_s, strict=False)]),
        calm=np.concatenate([size[at][calm[at]] for size, at, calm in zip(sizes, at_s, is_calm, strict=False)]),
        waits_s=np.concatenate([np.diff(at)[_within(ramp, at)] for at, ramp in zip(at_s, is_ramp, strict=False)]),
        held_share=1.0 - moved.size / max(sum(int(np.isfinite(size).sum()) for size in sizes), 1),
    )


def _within(is_ramp: Flags, at_s: Integers) -> Flags:
    """Which of the times from move to move lie within one ramp."""
    count = np.r_[0, np.cumsum(is_ramp)]
    return np.asarray(count[at_s[1:] + 1] - count[at_s[:-1]] == np.diff(at_s) + 1)


def _held(quantity: AnalogueQuantity, moves: _Moves, quantum: float) -> Pattern | None:
    """Pattern of a channel that is held: its deadband lies under the smallest moves that follow another soon.

    A move that is stored in steps may be off by one of them.

    Where such are few, and nearly all values are held, it lies over the largest move outside ramps, which its time
    being up has brought about.
    """
    soon, least = moves.soon, STORED_MOVES * quantum
    if moves.held_share > NEARLY_ALL and soon.size < MIN_MOVES and moves.calm.size >= FEWEST:
        largest = float(moves.calm.max())
        return Pattern(quantity=quantity, deadband=largest, within=BY_TIME) if largest > least else None
    unforced = soon if soon.size >= FEWEST else moves.all
    if moves.all.size < MIN_MOVES or float(np.quantile(unforced, SMALL)) <= least:
        return None
    if not (_has_edge(moves.all) or _has_edge(soon)):
        return None
    if soon.size < MIN_MOVES:
        return Pattern(quantity=quantity, deadband=float(np.quantile(moves.all, SMALL)), within=IN_RAMPS)
    deadband = float(np.quantile(soon, FEW))
    low, high = SEEN_SHARES if moves.is_soon_calm.sum() >= MIN_MOVES else IN_RAMPS
    rounding = quantum / deadband
    within = (low * (1.0 - rounding), high * (1.0 + rounding))
    return Pattern(quantity=quantity, deadband=deadband, pause_s=moves.pause_s, within=within)


def _has_edge(jumps: Floats) -> bool:
    """Whether moves under a size are missing, as under a deadband."""
    if jumps.size < MIN_MOVES:
        return False
    few, smallest, more, middle = (float(q) for q in np.quantile(jumps, [0.05, SMALL, 0.2, 0.5]))
    return smallest > DEAD_ZONE * middle or smallest < EDGE * few or more < EDGE * smallest
