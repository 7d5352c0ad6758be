"""The compiled parts of the detector, loaded or compiled before the first sample has to be judged."""

import numpy as np

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.stream.block import blocks
from wetwell.protocols.arrays import Floats
from wetwell.protocols.quantities import columns_of
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S

LEARNT_S = 25_200
"""A pump learns for six hours at least, and to the end of a run."""
MOVED_S = 3_600
RUN_S = 600
"""Each pump runs for so long, in turn, with a pause of the same length. [s]"""
NOISE = 0.01
HEAD_LOSS = 0.8


def load_kernels() -> None:
    """Let a detector of a made-up station learn and judge: all that it calls is compiled then, or loaded from disk.

    A kernel is compiled for the types of its arguments, which are the same for all stations. Takes a second where
    the compiled kernels are on disk, and half a minute where they are not.
    """
    station = Station.model_validate({"name": "made-up", "sump": {"area_m2": 8.0}, "pump": [_PUMP, _PUMP]})
    detector = Detector(station.name, datasheet_of(station))
    recording = _recording(station)
    for block in blocks(recording, len(station.pump)):
        detector.update_block(block)
    for sample in recording.samples(station.name):
        detector.update(sample)
        return


_PUMP = {"curve": [36.0, -0.02333, -1.3333e-4]}


def _recording(station: Station) -> Recording:
    """Two pumps that run in turn near their curves, and in the last hour with a lower head."""
    rng = np.random.default_rng(0)
    time_s = np.arange(LEARNT_S + MOVED_S)
    cycle = time_s // RUN_S % (2 * len(station.pump))
    flow_m3h = 200.0 * (1.0 + NOISE * rng.standard_normal(time_s.size))
    head_m = (36.0 - 0.02333 * 200.0 - 1.3333e-4 * 200.0**2) * (1.0 + NOISE * rng.standard_normal(time_s.size))
    head_m *= np.where(time_s < LEARNT_S, 1.0, HEAD_LOSS)
    columns = {name: np.full(time_s.size, np.nan) for name in columns_of(len(station.pump))}
    columns["level_m"] = 1.0 + 0.5 * np.abs(np.interp(time_s % (2 * RUN_S), [0, RUN_S, 2 * RUN_S], [1.0, 0.0, 1.0]))
    columns["inflow_m3h"] = np.full(time_s.size, 100.0)
    for pump in range(len(station.pump)):
        runs = cycle == 2 * pump
        of_pump: dict[str, float | Floats] = {
            "frequency_hz": 50.0,
            "flow_m3h": flow_m3h,
            "head_m": head_m,
            "power_kw": 20.0,
            "running": 1.0,
        }
        columns |= {f"pump{pump + 1}_{name}": np.where(runs, value, 0.0) for name, value in of_pump.items()}
    return Recording(time_ns=time_s * NS_PER_S, columns=columns, station=station.name)
