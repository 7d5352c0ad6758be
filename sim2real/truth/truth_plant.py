"""A true recording of a case, from the fine-step plant."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from wetwell.protocols.arrays import Flags, Floats, Integers
from wetwell.protocols.orders import first_place, orders_of
from wetwell.protocols.quantities import AnalogueQuantity, pump_column
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Sensors
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.truth import kernel
from wetwell.sim2real.truth.case import TruthCase
from wetwell.sim2real.truth.deviations import DEVIATIONS
from wetwell.sim2real.truth.faults import fault_states, force_faults, spoil
from wetwell.sim2real.truth.inflow import inflow_m3h, slow_noise
from wetwell.sim2real.truth.parts import Truth
from wetwell.sim2real.truth.spec import HOUR_S, Surroundings, spec_of
from wetwell.sim2real.truth.storage import stored
from wetwell.sim2real.truth.telemetry import Telemetry, sensed, transmitted

_QUIET = Sensors(flow_noise=0.0, head_noise=0.0, power_noise=0.0, inflow_noise=0.0, level_noise_m=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Passage:
    """What a plant has noted of a case: (2, n), (5, pumps, n) and (n,) as in `kernel`, SI units."""

    case: TruthCase
    made: Truth
    sensor_rng: np.random.Generator
    station_record: Floats
    pump_record: Floats
    step_record: Integers

    def recording(self, *, truth: bool) -> Recording:
        """The recording, to be taken once; a blind one has no truth columns."""
        columns = self._columns(self.case, self.station_record, self.sensor_rng)
        recording = Recording(
            time_ns=self._stamps_ns,
            columns=columns,
            truth=_truth_columns(self.case, self.made.around, self.station_record, self.pump_record) if truth else {},
            station=self.case.station.name,
        )
        return stored(recording, self.case.storage)

    def oracle(self) -> Recording:
        """What sensors without noise would have recorded: what a perfect model says of the recording."""
        station = self.case.station.model_copy(update={"sensors": _QUIET})
        station_record = self.station_record.copy()
        station_record[kernel.LEVEL_READING] -= self.made.level_noise_m
        case = replace(self.case, station=station)
        columns = self._columns(case, station_record, np.random.default_rng(0))
        recording = Recording(time_ns=self._stamps_ns, columns=columns, station=self.case.station.name)
        return stored(recording, self.case.storage)

    @property
    def lowest_level_m(self) -> float:
        """Lowest true level of the wet well. [m]."""
        return float(self.station_record[kernel.LEVEL].min())

    @property
    def _stamps_ns(self) -> Integers:
        return self.case.start_ns + NS_PER_S * np.arange(self.case.seconds)

    def _columns(self, case: TruthCase, station_record: Floats, rng: np.random.Generator) -> dict[str, Floats]:
        by_hand = orders_of(case.steps, len(case.station.pump)).columns(self.step_record)
        inflow_m3h = self.made.around.metered_inflow[:-1] * HOUR_S * by_hand.get("inlet_open", 1.0)
        return recorded(case, self.made.telemetry, inflow_m3h, station_record, self.pump_record, rng) | by_hand


def run(case: TruthCase, *, truth: bool = True) -> Recording:
    """Recording of a case; the same case gives the same bytes.

    Parameters
    ----------
    case : TruthCase
    truth : bool
        Whether to give the truth columns; a blind recording has none.

    Raises
    ------
    ValueError
        If a deviation is not known, or the station asks for what this plant does not have.
    """
    return passage_of(case).recording(truth=truth)


def passage_of(case: TruthCase) -> Passage:
    """The fine-step plant's passage through a case; raises as `run`."""
    made, sensor_rng = truth_of(case)
    station_record = np.empty((2, case.seconds))
    pump_record = np.empty((5, len(case.station.pump), case.seconds))
    step_record = np.empty(case.seconds, dtype=np.int64)
    around = made.around
    kernel.integrate(
        made.spec,
        case.initial_level_m,
        around.inflow,
        around.loss_factor,
        around.extra_lift_m,
        around.voltage_factor,
        around.speed_factor,
        around.level_error_m,
        around.is_level_stuck,
        orders_of(case.steps, len(case.station.pump)),
        first_place(),
        station_record,
        pump_record,
        step_record,
    )
    return Passage(
        case=case,
        made=made,
        sensor_rng=sensor_rng,
        station_record=station_record,
        pump_record=pump_record,
        step_record=step_record,
    )


def truth_of(case: TruthCase) -> tuple[Truth, np.random.Generator]:
    """Truth of a case, faults and deviations worked in, and the generator of its sensors.

    Raises
    ------
    ValueError
        If a deviation is not known, or the station asks for what this plant does not have.
    """
    inflow_rng, sensor_rng, deviation_rng = np.random.default_rng(case.seed).spawn(3)
    inflow = inflow_m3h(case.inflow, case.seconds, inflow_rng)
    seconds, pumps = case.seconds, len(case.station.pump)
    around = Surroundings(
        inflow=inflow / HOUR_S,
        metered_inflow=inflow / HOUR_S,
        loss_factor=np.ones(seconds),
        extra_lift_m=np.zeros(seconds),
        voltage_factor=np.ones(seconds),
        speed_factor=np.ones((pumps, seconds)),
        level_error_m=np.zeros(seconds),
        is_level_stuck=np.zeros(seconds),
    )
    made = Truth(
        station=case.station,
        spec=spec_of(case.station),
        around=around,
        telemetry=Telemetry(),
        rng=deviation_rng,
        level_noise_m=case.station.sensors.level_noise_m * _noise(case, sensor_rng),
    )
    for deviation in case.deviations:
        if deviation.name not in DEVIATIONS:
            raise ValueError(f"deviation '{deviation.name}' is not one of {', '.join(DEVIATIONS)}")
        DEVIATIONS[deviation.name].act(made, deviation.parameters)
    force_faults(case.faults, around)
    around.level_error_m[:] += made.level_noise_m
    return made, sensor_rng


def recorded(
    case: TruthCase,
    telemetry: Telemetry,
    metered_inflow_m3h: Floats,
    station_record: Floats,
    pump_record: Floats,
    rng: np.random.Generator,
) -> dict[str, Floats]:
    """Columns of the recording from the records of a plant.

    Parameters
    ----------
    case : TruthCase
    telemetry : Telemetry
    metered_inflow_m3h : (n,) array
        [m³/h]
    station_record, pump_record : (2, n) and (5, pumps, n) arrays
        Rows as in `kernel`, SI units.
    rng : numpy.random.Generator
        Of the sensors.
    """
    sensors = case.station.sensors
    always = np.ones(case.seconds, dtype=np.bool_)
    inflow_m3h = sensed(
        metered_inflow_m3h, always, sensors.inflow_noise * _noise(case, rng), telemetry.of("inflow_m3h")
    )
    columns = {
        "level_m": transmitted(station_record[kernel.LEVEL_READING], telemetry.of("level_m")),
        "inflow_m3h": transmitted(inflow_m3h, telemetry.of("inflow_m3h")),
    }
    for i, pump in enumerate(case.station.pump):
        command, _, head, power, damped = pump_record[:, i]
        turns = command > 0.0
        frequency_hz = transmitted(command * pump.nominal_frequency_hz, telemetry.of("frequency_hz"))
        columns[pump_column(i + 1, "frequency_hz")] = frequency_hz
        flow_m3h = damped * HOUR_S
        quantities: tuple[tuple[AnalogueQuantity, Floats, Flags, float], ...] = (
            ("flow_m3h", flow_m3h, turns | (flow_m3h > 1e-3), sensors.flow_noise),
            ("head_m", head, turns, sensors.head_noise),
            ("power_kw", power / 1000.0, turns, sensors.power_noise),
        )
        for quantity, values, is_alive, noise in quantities:
            channel = telemetry.of(quantity)
            reading = sensed(values, is_alive, noise * _noise(case, rng), channel)
            columns[pump_column(i + 1, quantity)] = transmitted(reading, channel)
        columns[pump_column(i + 1, "running")] = (frequency_hz > 0.0).astype(np.float64)
    spoil(case.faults, columns)
    return columns


def _noise(case: TruthCase, rng: np.random.Generator) -> Floats:
    """(n,) noise of unit variance, white with a slow share."""
    white = rng.standard_normal(case.seconds)
    if case.slow_share <= 0.0:
        return white
    slow = slow_noise(case.seconds, case.slow_s, rng)
    mixed: Floats = np.sqrt(1.0 - case.slow_share) * white + np.sqrt(case.slow_share) * slow
    return mixed


def _truth_columns(
    case: TruthCase, around: Surroundings, station_record: Floats, pump_record: Floats
) -> dict[str, npt.NDArray[Any]]:
    """Truth columns as the simulator names them; a level sensor's or the station's fault is felt by all pumps."""
    truth: dict[str, npt.NDArray[Any]] = {
        "truth_state": fault_states(case.faults, None, case.seconds),
        "truth_level_m": station_record[kernel.LEVEL],
        "truth_inflow_m3h": around.inflow[:-1] * HOUR_S,
        "truth_friction_factor": around.loss_factor,
        "truth_static_rise_m": around.extra_lift_m,
    }
    for i in range(len(case.station.pump)):
        truth |= {
            f"truth_pump{i + 1}_state": fault_states(case.faults, i + 1, case.seconds),
            f"truth_pump{i + 1}_speed_factor": around.speed_factor[i],
            f"truth_pump{i + 1}_flow_m3h": pump_record[kernel.FLOW, i] * HOUR_S,
            f"truth_pump{i + 1}_head_m": pump_record[kernel.HEAD, i],
            f"truth_pump{i + 1}_power_kw": pump_record[kernel.POWER, i] / 1000.0,
        }
    return truth
