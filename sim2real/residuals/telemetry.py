"""Residuals of the telemetry itself: values that are held, values that lie on a lattice."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.protocols.station.station_file import Sensors, Station
from wetwell.sim2real.recording.regimes import START_RAMP, STEADY, STOP_RAMP, Regimes
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.held import FEWEST, MIN_MOVES, held_between_rows, held_each_second, moves_of
from wetwell.sim2real.replay.lattice import lattice
from wetwell.sim2real.replay.replay import Prediction
from wetwell.sim2real.residuals.bins import NO_PUMP, TELEMETRY, Bins
from wetwell.sim2real.residuals.noise import configured_noise
from wetwell.sim2real.residuals.phases import PHASES_S
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.effects.effect import Component
from wetwell.simulator.telemetry.channels import channels_of

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

    def components(self, acting: Collection[str]) -> dict[AnalogueQuantity, Component]:
        """Where the patterns come from that count and that no effect among these makes, by channel."""
        unexplained = [pattern for pattern in _told(self.patterns) if pattern.effect not in acting]
        return {pattern.quantity: EFFECTS[pattern.effect].component for pattern in unexplained}

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
    if traces.span_s > 1:
        return []
    if traces.value == "held":
        level_m = traces.level_m[traces.is_row]
        return _rounding(lattice(level_m)) if np.isfinite(level_m).any() else []
    is_row = np.ones(traces.seconds, dtype=np.bool_) if traces.is_each_second else traces.is_row
    held_of = held_each_second if traces.is_each_second else held_between_rows
    running = traces.frequency_hz > 0.0
    series: list[tuple[AnalogueQuantity, list[Floats]]] = [("level_m", [traces.level_m])]
    if traces.inflow_m3h is not None:
        series.append(("inflow_m3h", [traces.inflow_m3h]))
    for name, values in traces.signals.items():
        series.append((name, [np.where(running[i], values[i], np.nan) for i in range(traces.pumps)]))
    noise = configured_noise(sensors)
    found = []
    for quantity, each in series:
        if noise[quantity] <= 0.0:
            continue
        parts = [values[is_row] for values in each]
        is_ramp = np.isin(regimes.of_pumps[: len(parts), is_row], (START_RAMP, STOP_RAMP))
        moves = moves_of(parts, is_ramp & (quantity in traces.signals), traces.rate_s)
        if moves.all.size < FEWEST:
            continue
        quantum = lattice(np.concatenate(parts))
        if quantity == "level_m" and moves.all.size >= MIN_MOVES:
            found += _rounding(quantum)
        held = held_of(moves, quantum)
        if held is not None:
            found.append(Pattern(quantity=quantity, deadband=held.deadband, within=held.within, pause_s=held.pause_s))
    return found


def _rounding(quantum_m: float) -> list[Pattern]:
    """Pattern of a level that lies on a lattice."""
    return [Pattern(quantity="level_m", quantum=quantum_m)] if quantum_m >= MIN_QUANTUM_M else []
