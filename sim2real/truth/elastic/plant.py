"""A true recording of a case, from the elastic plant."""

import hashlib
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.orders import orders_of
from wetwell.protocols.quantities import AnalogueQuantity, pump_column
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Sensors, Station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.truth.case import TruthCase
from wetwell.sim2real.truth.elastic import kernel
from wetwell.sim2real.truth.elastic.deviations import ELASTIC_DEVIATIONS
from wetwell.sim2real.truth.elastic.instruments import Instrument, Instruments, arrived, read, sensor_noise
from wetwell.sim2real.truth.elastic.kind import ElasticTruth
from wetwell.sim2real.truth.elastic.spec import HOUR_S, Machinery, spec_of
from wetwell.sim2real.truth.elastic.weather import inflow_m3h
from wetwell.sim2real.truth.storage import stored

_QUIET = Sensors(flow_noise=0.0, head_noise=0.0, power_noise=0.0, inflow_noise=0.0, level_noise_m=0.0)
_STILL_M3H = 1e-3
"""Flow under which a standing pump's meter reads 0. [m³/h]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class ElasticPassage:
    """What the plant has noted of a case: (2, n), (5, pumps, n) and (n,) as in `kernel`, SI units."""

    case: TruthCase
    truth: ElasticTruth
    level_noise_m: Floats
    meter_seed: int
    station_record: Floats
    pump_record: Floats
    step_record: Integers

    def recording(self, *, truth: bool = False) -> Recording:
        """The recording; the level and flows that are true beside it, if asked for."""
        columns = self._columns(self.case.station.sensors, self.station_record[kernel.READING])
        told = {"truth_level_m": self.station_record[kernel.LEVEL]} | {
            f"truth_pump{i + 1}_flow_m3h": flows * HOUR_S for i, flows in enumerate(self.pump_record[kernel.FLOW])
        }
        return self._stored(columns, told if truth else {})

    def oracle(self) -> Recording:
        """What sensors without noise would have recorded."""
        return self._stored(self._columns(_QUIET, self.station_record[kernel.READING] - self.level_noise_m), {})

    @property
    def lowest_level_m(self) -> float:
        """Lowest true level of the wet well. [m]."""
        return float(self.station_record[kernel.LEVEL].min())

    def _stored(self, columns: dict[str, Floats], truth: dict[str, Floats]) -> Recording:
        case = self.case
        time_ns = case.start_ns + NS_PER_S * np.arange(case.seconds)
        return stored(
            Recording(time_ns=time_ns, columns=columns, truth=truth, station=case.station.name), case.storage
        )

    def _columns(self, sensors: Sensors, reading_m: Floats) -> dict[str, Floats]:
        rng, seconds = np.random.default_rng(self.meter_seed), self.case.seconds
        instruments = self.truth.instruments

        def seen(quantity: AnalogueQuantity, values: Floats, is_alive: Floats, share: float) -> Floats:
            instrument = instruments.of_all.get(quantity, Instrument())
            noise = share * sensor_noise(seconds, self.case.slow_share, self.case.slow_s, rng)
            return arrived(read(values, is_alive > 0.0, noise, instrument), instrument)

        always = np.ones(seconds)
        by_hand = orders_of(self.case.steps, len(self.case.station.pump)).columns(self.step_record)
        metered_m3h = self.truth.metered_inflow[:-1] * HOUR_S * by_hand.get("inlet_open", 1.0)
        columns = {
            "level_m": arrived(reading_m, instruments.of_all.get("level_m", Instrument())),
            "inflow_m3h": seen("inflow_m3h", metered_m3h, always, sensors.inflow_noise),
        }
        for i, pump in enumerate(self.case.station.pump):
            told, _, head_m, power_w, flow = self.pump_record[:, i]
            flow_m3h = flow * HOUR_S
            frequency_hz = arrived(
                told * pump.nominal_frequency_hz, instruments.of_all.get("frequency_hz", Instrument())
            )
            moves = np.where(flow_m3h > _STILL_M3H, 1.0, told)
            columns |= {
                pump_column(i + 1, "frequency_hz"): frequency_hz,
                pump_column(i + 1, "flow_m3h"): seen("flow_m3h", flow_m3h, moves, sensors.flow_noise),
                pump_column(i + 1, "head_m"): seen("head_m", head_m, told, sensors.head_noise),
                pump_column(i + 1, "power_kw"): seen("power_kw", power_w / 1000.0, told, sensors.power_noise),
                pump_column(i + 1, "running"): (frequency_hz > 0.0).astype(np.float64),
            }
        return columns | by_hand


def run_elastic(case: TruthCase, *, truth: bool = True) -> Recording:
    """Recording of a case; the same case gives the same bytes.

    Raises
    ------
    ValueError
        If a deviation is not known, or the case asks for what this plant does not have.
    """
    return passage_of(case).recording(truth=truth)


def passage_of(case: TruthCase) -> ElasticPassage:
    """The elastic plant's passage through a case; raises as `run_elastic`."""
    if case.faults:
        raise ValueError("a case for the elastic plant can have no faults")
    weather_rng, level_rng, meter_rng, deviation_rng = np.random.default_rng(case.seed).spawn(4)
    inflow = inflow_m3h(case.inflow, case.seconds, weather_rng) / HOUR_S
    seconds, pumps = case.seconds, len(case.station.pump)
    machinery = machinery_of(case.station)
    level_noise_m = case.station.sensors.level_noise_m * sensor_noise(
        seconds, case.slow_share, case.slow_s, level_rng
    )
    truth = ElasticTruth(
        station=case.station,
        machinery=machinery,
        spec=spec_of(case.station, machinery),
        weather=kernel.Weather(
            inflow=inflow.copy(),
            loss=np.ones(seconds),
            lift_m=np.zeros(seconds),
            voltage=np.ones(seconds),
            speed=np.ones((pumps, seconds)),
            reading_error_m=level_noise_m.copy(),
        ),
        instruments=Instruments(),
        metered_inflow=inflow,
        rng=deviation_rng,
    )
    for deviation in case.deviations:
        if deviation.name not in ELASTIC_DEVIATIONS:
            raise ValueError(f"deviation '{deviation.name}' is not one of {', '.join(ELASTIC_DEVIATIONS)}")
        ELASTIC_DEVIATIONS[deviation.name].act(truth, deviation.parameters)
    station_record, pump_record = np.empty((2, seconds)), np.empty((5, pumps, seconds))
    step_record = np.empty(seconds, dtype=np.int64)
    kernel.integrate(
        truth.spec,
        case.initial_level_m,
        truth.weather,
        orders_of(case.steps, pumps),
        station_record,
        pump_record,
        step_record,
    )
    return ElasticPassage(
        case=case,
        truth=truth,
        level_noise_m=level_noise_m,
        meter_seed=int(meter_rng.integers(2**31)),
        station_record=station_record,
        pump_record=pump_record,
        step_record=step_record,
    )


def machinery_of(station: Station) -> Machinery:
    """What no file tells of a station: at random, but the same for the same station whatever the weather."""
    digest = hashlib.sha256(station.model_dump_json().encode()).digest()
    rng = np.random.default_rng(int.from_bytes(digest[:8], "big"))
    return Machinery(
        velocity_m_s=rng.uniform(0.9, 2.0),
        wave_m_s=rng.uniform(250.0, 1200.0),
        length_m=rng.uniform(10.0, 40.0),
        roughness_mm=rng.uniform(0.05, 0.8),
        inertia_s=rng.uniform(0.1, 0.25),
        rated_slip=rng.uniform(0.006, 0.018),
        breakdown_torque=rng.uniform(2.0, 3.0),
        copper=rng.uniform(0.02, 0.04),
        iron=rng.uniform(0.01, 0.025),
        standing=rng.uniform(0.005, 0.015),
        scan_s=rng.uniform(0.1, 1.0),
        scan_offset_s=rng.uniform(0.0, 1.0),
        meter_s=rng.uniform(0.05, 0.25),
    )
