"""What the simulator says for a recording, teacher-forced: frequency, inflow and level come from the recording."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.quantities import INFLOW, LEVEL, PUMP_METERS, AnalogueQuantity
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.traces import Traces, repeated
from wetwell.sim2real.replay.kernel import replay_seconds
from wetwell.simulator.effects.effect import Effect
from wetwell.simulator.forcing import Forcing, healthy_forcing
from wetwell.simulator.parameters import PlantParameters, plant_parameters
from wetwell.simulator.state import first_state, still_truth
from wetwell.simulator.telemetry.channels import channels_of

LEVEL_TIME_S = 150.0
"""Time constant with which the observer follows the recorded level."""
FIRST = 5
"""Values of the level from which the observer begins."""
UNKNOWN_INFLOW_TIME_S = 300.0
"""Time constant with which it follows where the inflow has to be followed too."""
KEPT_RUNS = 3
"""Runs that are kept: what only the telemetry or the controller does differently is not computed again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """What the sensors would read, without noise: level (n,), signals of pumps (pumps, n).

    The arrays are to be read only: several predictions may share them. `plant` holds the parameters that they come
    from, for what is read off events and telemetry.
    """

    level_m: Floats
    signals: dict[AnalogueQuantity, Floats]
    plant: PlantParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """What the kernel was given, and what it made of it."""

    key: tuple[object, ...]
    level_m: Floats
    reading: Floats


class Replay:
    """A recording and a station, ready to be replayed under any effects, also side by side.

    Parameters
    ----------
    traces : Traces
    station : Station
        Its own effects act before those that are tried.
    own : sequence of Effect
        Effects of the station file.
    """

    def __init__(self, traces: Traces, station: Station, own: Sequence[Effect] = ()) -> None:
        self.traces = traces
        self.station = station
        self.own = tuple(own)
        inflow_m3h = np.zeros(traces.seconds) if traces.inflow_m3h is None else traces.inflow_m3h
        self._forcing = healthy_forcing(inflow_m3h, traces.pumps)
        self._kept: tuple[_Run, ...] = ()
        self._told_level_m = np.where(repeated(traces.level_m), np.nan, traces.level_m)
        known = np.flatnonzero(np.isfinite(traces.level_m))
        first = traces.level_m[known[:FIRST]]  # a single value may be wrong
        self._first_level_m = float(np.median(first)) if known.size else station.middle_level_m

    def run(self, effects: Sequence[Effect] = ()) -> Prediction:
        """Predict under effects.

        Raises
        ------
        ValueError
            If an effect does not fit the station.
        """
        acting = (*self.own, *effects)
        plant = plant_parameters(self.station)
        for effect in acting:
            plant = effect.modify(plant)
        run = self._run(acting, plant)
        level_m, reading = run.level_m, run.reading
        signals = {
            name: later(reading[k], _delay_s(plant, name))
            for k, name in enumerate(PUMP_METERS)
            if name in self.traces.signals
        }
        delay_s = plant.sensors[LEVEL].delay_s
        return Prediction(level_m=later(level_m, delay_s), signals=signals, plant=plant)

    def _run(self, acting: Sequence[Effect], plant: PlantParameters) -> _Run:
        """Run of the kernel; one that is kept, where the plant differs from its plant in nothing that it reads."""
        traces, pumps = self.traces, self.traces.pumps
        is_held = plant.sensors[LEVEL].deadband > 0.0
        frequency_delay_s = _delay_s(plant, "frequency_hz")
        forces = tuple(effect for effect in acting if type(effect).force is not Effect.force)
        records = replace(plant, control_delay_s=0.0).records()
        read = tuple((sensor.gain, sensor.offset, sensor.followed, sensor.cutoff) for sensor in plant.sensors)
        delays_s = (frequency_delay_s, plant.sensors[LEVEL].delay_s, plant.sensors[INFLOW].delay_s)
        station, profile = np.asarray(records.station).tolist(), np.asarray(records.profile).tolist()
        key = (station, plant.mains, plant.pumps, profile, read, is_held, delays_s, forces)
        for run in self._kept:
            if run.key == key:
                return run
        level_m = np.empty(traces.seconds)
        reading = np.empty((len(PUMP_METERS), pumps, traces.seconds))
        if traces.inflow_m3h is None:
            gains = 1.4 / UNKNOWN_INFLOW_TIME_S, 1.0 / UNKNOWN_INFLOW_TIME_S**2
        else:
            gains = 1.0 / LEVEL_TIME_S, 0.0
        replay_seconds(
            records,
            first_state(plant, max(self._first_level_m, plant.profile["level_m"][0])),
            self._forced(forces, plant),
            np.zeros((len(PUMP_METERS), pumps)),
            np.ascontiguousarray(later(traces.frequency_hz, -frequency_delay_s)),
            self._told_level_m if is_held else traces.level_m,
            *gains,
            still_truth(pumps, 1),
            level_m,
            reading,
        )
        run = _Run(key=key, level_m=level_m, reading=reading)
        self._kept = (*self._kept[1 - KEPT_RUNS :], run)
        return run

    def _forced(self, writing: Sequence[Effect], plant: PlantParameters) -> Forcing:
        """Forcing of the recording; a copy where effects are `writing` into it."""
        delay_s = plant.sensors[INFLOW].delay_s
        if not writing and delay_s == 0.0:
            return self._forcing
        forcing = healthy_forcing(later(self._forcing.inflow_m3h, -delay_s), self.traces.pumps)
        for effect in writing:
            effect.force(forcing, self.traces.time_s)
        return forcing


def later(values: Floats, delay_s: float) -> Floats:
    """(..., n) values as they stood `delay_s` seconds ago; negative: as they will stand. The ends are held.

    Examples
    --------
    >>> later(np.array([0.0, 1.0, 2.0]), 0.5), later(np.array([0.0, 1.0, 2.0]), -1.0)
    (array([0. , 0.5, 1.5]), array([1., 2., 2.]))
    """
    if delay_s == 0.0:
        return values
    whole = int(np.floor(delay_s))
    share = delay_s - whole
    place = np.arange(values.shape[-1]) - whole
    near = values[..., np.clip(place, 0, place.size - 1)]
    far = values[..., np.clip(place - 1, 0, place.size - 1)]
    return np.asarray((1.0 - share) * near + share * far, dtype=np.float64)


def _delay_s(plant: PlantParameters, quantity: AnalogueQuantity) -> float:
    return plant.sensors[channels_of(quantity, len(plant.pumps))[0]].delay_s
