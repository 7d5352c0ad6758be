"""What the simulator says for a recording, teacher-forced: frequency, inflow and level come from the recording."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.orders import SHUT_LOSS
from wetwell.protocols.quantities import INFLOW, LEVEL, PUMP_METERS, AnalogueQuantity
from wetwell.protocols.recordings.covariates import COVARIATE_PREFIX
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.column_noise import course_of
from wetwell.sim2real.recording.regimes import IDLE, MULTI_PUMP, STEADY, regimes_of
from wetwell.sim2real.recording.seconds import is_change, trailing_means
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.changing import Acting, Changing, in_period
from wetwell.sim2real.replay.held import as_sent
from wetwell.sim2real.replay.inflow_process import MOST_SQUARE, InflowProcess, learnt_process
from wetwell.sim2real.replay.kernel import replay_seconds
from wetwell.sim2real.replay.level_filter import BEGUN_ANEW
from wetwell.sim2real.replay.level_noise import least_noise_m, told_by_steps_m
from wetwell.sim2real.replay.metered_inflow import metered_inflow
from wetwell.sim2real.replay.observer import (
    Observer,
    constant_observer,
    forced_observer,
    hides_cycles,
    lost_after_s,
    row_observer,
    uncertain_of,
)
from wetwell.simulator.corrections.parts import Column
from wetwell.simulator.effects.effect import Effect
from wetwell.simulator.forcing import Forcing, healthy_forcing
from wetwell.simulator.parameters import PlantParameters, PlantRecords, SensorParameters, plant_parameters
from wetwell.simulator.state import first_state, still_truth
from wetwell.simulator.telemetry.channels import channels_of

FIRST = 5
"""Values of the level from which the observer begins."""
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
class Doubt:
    """Standard deviations of what a right model predicts, in the unit of the signal.

    `level_m` (n,) has all that the level may be off, its sensor's noise included, or is None where the observer does
    not know; `signals` (pumps, n) what moments that the rows do not show leave open, empty where they show all;
    `observer` follows the level.
    """

    level_m: Floats | None
    signals: dict[AnalogueQuantity, Floats]
    observer: Observer


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """What the kernel was given, and what it made of it."""

    key: tuple[object, ...]
    level_m: Floats
    reading: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class _Lagging:
    """Observer of a level that lags, and what it was made of."""

    of: Observer
    lag: tuple[float, ...]
    observer: Observer


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
        self.period = traces.period
        self._metered = metered_inflow(traces)
        inflow_m3h = np.zeros(traces.seconds) if self._metered is None else self._metered.course_m3h
        self._forcing = self._healthy(inflow_m3h, None)
        self._courses: dict[Column, Floats] = {}
        self._configured = plant_parameters(station)
        self._columns(self._plant(self.own).columns)  # a station file that cannot be replayed is told at once
        self._kept: tuple[_Run, ...] = ()
        self._lagging: _Lagging | None = None
        told_m = told_by_steps_m(traces)
        if told_m is None:
            self.observer = self._observer_of(traces.level_m)
        else:
            self.observer = replace(self._begun_anew(told_m), is_of_steps=True)

    def run(self, effects: Sequence[Acting] = ()) -> Prediction:
        """Predict under effects; of those that change from period to period, the plant is that of the last.

        Raises
        ------
        ValueError
            If an effect does not fit the station.
        """
        if not any(isinstance(effect, Changing) for effect in effects):
            return self._predict([in_period(effect, 0) for effect in effects])
        periods = [
            self._predict([in_period(effect, k) for effect in effects]) for k in range(int(self.period[-1]) + 1)
        ]
        place = np.arange(self.period.size)
        level_m = np.array([one.level_m for one in periods])[self.period, place]
        signals = {
            name: np.moveaxis(np.array([one.signals[name] for one in periods])[self.period, :, place], 0, 1)
            for name in periods[-1].signals
        }
        return Prediction(level_m=level_m, signals=signals, plant=periods[-1].plant)

    def _predict(self, effects: Sequence[Effect]) -> Prediction:
        acting = (*self.own, *effects)
        plant = self._plant(acting)
        run = self._run(acting, plant)
        return self._predicted(plant, run.level_m, run.reading)

    def readings(self, effects: Sequence[Effect]) -> Floats:
        """(3, pumps, n) flow, head and power of each second under effects, also of sensors that are missing.

        Raises
        ------
        ValueError
            If an effect does not fit the station.
        """
        acting = (*self.own, *effects)
        plant = self._plant(acting)
        read = self._run(acting, plant).reading
        return np.array([later(one, _delay_s(plant, name)) for name, one in zip(PUMP_METERS, read, strict=True)])

    def doubt(self, is_level_held: bool) -> Doubt:
        r"""What the moments that the rows do not show, or how the level is told, leave open in what is predicted.

        $$\sigma^2 = \frac{(y_\text{early} - y_\text{late})^2 + (y_\text{long} - y_\text{short})^2}{24}$$

        for starts and stops that lie anywhere in what is possible, one as likely as another, each by itself.
        """
        observer = self._observer_of_changes if is_level_held else self.observer
        placements = self.traces.drives.placements
        if not placements:
            return Doubt(level_m=observer.deviation_m, signals={}, observer=observer)
        plant = self._plant(self.own)
        early, late, long, short = (
            self._predicted(plant, *self._computed(self.own, plant, _records(plant), placement, observer))
            for placement in placements
        )

        def spread(*values: Floats) -> Floats:
            first, second, third, fourth = values
            return np.sqrt(((first - second) ** 2 + (third - fourth) ** 2) / 24.0)

        signals = {
            name: spread(*(one.signals[name] for one in (early, late, long, short))) for name in self.traces.signals
        }
        level_m = observer.deviation_m
        if level_m is not None and self.traces.span_s > 1:  # the observer knows of instants only
            level_m = np.hypot(level_m, spread(*(one.level_m for one in (early, late, long, short))))
        return Doubt(level_m=level_m, signals=signals, observer=observer)

    def _plant(self, acting: Sequence[Effect]) -> PlantParameters:
        plant = self._configured
        for effect in acting:
            plant = effect.modify(plant)
        return plant

    def _predicted(self, plant: PlantParameters, level_m: Floats, reading: Floats) -> Prediction:
        """What the sensors read as the recording stores it."""
        span_s = self.traces.span_s
        signals = {
            name: trailing_means(later(reading[k], _delay_s(plant, name)), span_s)
            for k, name in enumerate(PUMP_METERS)
            if name in self.traces.signals
        }
        told_m = later(level_m, int(plant.sensors[LEVEL].delay_s))
        return Prediction(level_m=trailing_means(told_m, span_s), signals=signals, plant=plant)

    def _run(self, acting: Sequence[Effect], plant: PlantParameters) -> _Run:
        """Run of the kernel; one that is kept, where the plant differs from its plant in nothing that it reads."""
        is_held = plant.sensors[LEVEL].deadband > 0.0
        frequency_delay_s = _delay_s(plant, "frequency_hz")
        forces = tuple(effect for effect in acting if type(effect).force is not Effect.force)
        records = _records(plant)
        read = tuple(
            (
                *(sensor.gain, sensor.offset, sensor.followed, sensor.followed_again, sensor.carried),
                *(sensor.late, sensor.late_again, sensor.cutoff),
            )
            for sensor in plant.sensors
        )
        delays_s = (frequency_delay_s, plant.sensors[LEVEL].delay_s, plant.sensors[INFLOW].delay_s)
        station, profile = np.asarray(records.station).tolist(), np.asarray(records.profile).tolist()
        corrections = (plant.corrections, plant.columns)
        key = (station, plant.mains, plant.pumps, profile, read, is_held, delays_s, corrections, forces)
        for run in self._kept:
            if run.key == key:
                return run
        observer = self._observer_of_changes if is_held else self.observer
        level_m, reading = self._computed(acting, plant, records, self.traces.frequency_hz, observer)
        run = _Run(key=key, level_m=level_m, reading=reading)
        self._kept = (*self._kept[1 - KEPT_RUNS :], run)
        return run

    def _computed(
        self,
        acting: Sequence[Effect],
        plant: PlantParameters,
        records: PlantRecords,
        frequency_hz: Floats,
        observer: Observer,
    ) -> tuple[Floats, Floats]:
        """(n,) level and (3, pumps, n) flow, head and power as the sensors read them, by the kernel."""
        traces, pumps = self.traces, self.traces.pumps
        forces = tuple(effect for effect in acting if type(effect).force is not Effect.force)
        is_held = observer.level_m is not traces.level_m
        observer = self._of_lagging_level(observer, plant.sensors[LEVEL])
        observer = observer.of_late_level(int(plant.sensors[LEVEL].delay_s))
        told_m = traces.level_m[int(plant.sensors[LEVEL].delay_s) :]
        first = told_m[np.isfinite(told_m)][:FIRST]  # a single value may be wrong
        first_level_m = float(np.median(first)) if first.size else self.station.middle_level_m
        level_m = np.empty(traces.seconds)
        reading = np.zeros((len(PUMP_METERS), pumps, traces.seconds))
        replay_seconds(
            records,
            first_state(plant, max(first_level_m, plant.profile["level_m"][0])),
            self._forced(forces, plant),
            np.zeros((3, len(PUMP_METERS), pumps)),
            np.ascontiguousarray(later(frequency_hz, -_delay_s(plant, "frequency_hz"))),
            observer.level_m,
            observer.level_gain,
            observer.inflow_gain,
            observer.sensor_gain,
            observer.inflow_kept,
            traces.by_hand.is_inlet_shut,
            1 if is_held and traces.span_s > 1 else traces.span_s,
            still_truth(pumps, 1),
            level_m,
            reading,
        )
        return level_m, reading

    def _of_lagging_level(self, observer: Observer, sensor: SensorParameters) -> Observer:
        """Observer of a level that lags; the last one, where neither the lag nor the observer is another."""
        lag = (sensor.followed, sensor.followed_again, sensor.carried, sensor.late, sensor.late_again)
        last = self._lagging
        if last is None or last.of is not observer or last.lag != lag:
            last = self._lagging = _Lagging(of=observer, lag=lag, observer=observer.of_lagging_level(sensor))
        return last.observer

    @cached_property
    def _observer_of_changes(self) -> Observer:
        level_m = self.traces.level_m
        if self.traces.is_each_second or self.traces.value != "instant":
            return self._begun_anew(np.where(is_change(level_m), level_m, np.nan))
        return self._begun_anew(as_sent(level_m, self.traces.rate_s))

    def _begun_anew(self, level_m: Floats) -> Observer:
        """Observer of some values of the level, that begins with the first of them."""
        observer = self._observer_of(level_m)
        first = np.flatnonzero(np.isfinite(observer.level_m))[:1]
        level_gain, sensor_gain = observer.level_gain.copy(), observer.sensor_gain.copy()
        level_gain[first] = sensor_gain[:, first] = BEGUN_ANEW
        return replace(observer, level_gain=level_gain, sensor_gain=sensor_gain)

    def _observer_of(self, level_m: Floats) -> Observer:
        """Observer of a level; where the inflow is not measured, as the process that rows at rest show."""
        traces, station = self.traces, self.station
        if hides_cycles(traces, station):
            forced = forced_observer(traces)
            return forced if level_m is traces.level_m else replace(forced, level_m=level_m)
        if traces.inflow_m3h is not None and traces.is_each_second:
            return constant_observer(level_m, lost_after_s(level_m, traces.level_m))
        plant = self._plant(self.own)
        uncertain, sensor = uncertain_of(traces, station, self._metered, level_m), plant.sensors[LEVEL]
        if traces.inflow_m3h is not None:
            return row_observer(level_m, InflowProcess(lags_s=(0.0,), under=(uncertain,)), sensor)
        regime = regimes_of(traces, station).of_station
        settled = uncertain.is_known & _settled(regime)
        carried_m_s = float(np.max(plant.rated_flow_m3h)) / 3600.0 / station.sump.mean_area_m2
        idle, least_m = regime == IDLE, least_noise_m(station)
        process = learnt_process(uncertain, level_m, idle, settled, sensor, carried_m_s, traces.rate_s, least_m)
        observer = row_observer(level_m, process, sensor)
        return self._widened(observer, plant, settled & np.isin(regime, (IDLE, STEADY, MULTI_PUMP)))

    def _widened(self, observer: Observer, plant: PlantParameters, rows: Flags) -> Observer:
        """The same with deviations as large as errors of some levels are, if that is more; none counts for much."""
        traces = self.traces
        if observer.deviation_m is None or not rows.any():
            return observer
        level_m = self._computed(self.own, plant, _records(plant), traces.frequency_hz, observer)[0]
        errors_m = observer.level_m - trailing_means(level_m, traces.span_s)
        squares = (errors_m / observer.deviation_m)[rows] ** 2
        scale = np.sqrt(max(float(np.mean(np.minimum(squares, MOST_SQUARE))), 1.0))
        return replace(observer, deviation_m=scale * observer.deviation_m)

    def _healthy(self, inflow_m3h: Floats, columns: Floats | None) -> Forcing:
        """Forcing without faults, the valves of the mains as the crew had them."""
        traces = self.traces
        forcing = healthy_forcing(
            inflow_m3h, traces.pumps, len(self.station.mains), clock_s=traces.clock_s, columns=columns
        )
        forcing.friction_factor[:, traces.by_hand.is_valve_shut] *= SHUT_LOSS
        return forcing

    def _forced(self, writing: Sequence[Effect], plant: PlantParameters) -> Forcing:
        """Forcing of the recording; a copy where effects are `writing` into it."""
        delay_s = plant.sensors[INFLOW].delay_s
        if not writing and delay_s == 0.0 and not plant.columns:
            return self._forcing
        forcing = self._healthy(later(self._forcing.inflow_m3h, -delay_s), self._columns(plant.columns))
        for effect in writing:
            effect.force(forcing, self.traces.time_s)
        return forcing

    def _columns(self, columns: Sequence[Column]) -> Floats:
        """(columns, n) columns of the user that corrections go by."""
        missing = [column.name for column in columns if column.name not in self.traces.columns]
        if missing:
            raise ValueError(
                f"column '{COVARIATE_PREFIX}{missing[0]}' is missing, or most of its rows are empty: a correction of "
                "the station file goes by it"
            )
        for column in columns:
            if column not in self._courses:
                self._courses[column] = course_of(self.traces, column)
        return np.array([self._courses[column] for column in columns]).reshape(len(columns), self.traces.seconds)


def _settled(regime: Integers) -> Flags:
    """(n,) the later half of each time in a regime: what a switch sets off is over, the inflow moves the level."""
    place = np.arange(regime.size)
    edges = np.flatnonzero(np.diff(regime)) + 1
    begin, end = np.r_[0, edges], np.r_[edges, regime.size]
    return np.asarray(place >= np.repeat(0.5 * (begin + end), end - begin))


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


def _records(plant: PlantParameters) -> PlantRecords:
    """What the kernel reads: it has the frequencies, and no controller."""
    return replace(plant, control_delay_s=0.0).records()


def _delay_s(plant: PlantParameters, quantity: AnalogueQuantity) -> float:
    return plant.sensors[channels_of(quantity, len(plant.pumps))[0]].delay_s
