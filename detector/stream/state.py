"""The state of a station's stream between two samples: all arrays that the compiled loop reads and changes."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.statistics.rolling_f_test import RollingFTest
from wetwell.detector.stream.drawdown import new_phases
from wetwell.detector.stream.gate import gate_ranges, new_gate
from wetwell.detector.stream.missing_signals import new_missing_signals
from wetwell.detector.stream.run_state import new_pumps, new_sampling_period
from wetwell.detector.stream.sampling_steps import new_sampling_steps
from wetwell.detector.stream.steady_samples import new_steady_samples
from wetwell.detector.stream.stuck_sensors import new_stuck_sensors
from wetwell.protocols.arrays import Floats, Integers, Records
from wetwell.protocols.quantities import FIRST_PUMP, PUMP_VALUES


class StreamState(NamedTuple):
    """Named and ordered as `process_samples` takes them; what is not of the station is part of a snapshot.

    Attributes
    ----------
    table, ranges, area_m2
        Of the station: datasheet, ranges of its readings, cross-section of the wet well. [m²]
    frame : (2 + 5 pumps,) array
        Values of the last sample, without those that cannot be.
    gate, pumps, sampling_period, steady_samples, phases, stuck_sensors, missing_signals : arrays of records
        Each as the `new_...` of its module makes it.
    windows, moments, counts : arrays
        Of `RollingFTest`.
    sampling_steps : (6,) array
        As `new_sampling_steps` makes it.
    lacks_head : (pumps,) int64
        Whether a pump is judged without a head sensor, by the head that its main takes by the datasheet.
    """

    table: Records
    ranges: Records
    area_m2: float
    frame: Floats
    gate: Records
    pumps: Records
    sampling_period: Records
    steady_samples: Records
    phases: Records
    stuck_sensors: Records
    missing_signals: Records
    windows: Floats
    moments: Floats
    counts: Integers
    sampling_steps: Floats
    lacks_head: Integers

    def remembered(self) -> dict[str, npt.NDArray[Any]]:
        """The arrays from which the stream goes on, by name."""
        fields = self._asdict()
        return {name: fields[name] for name in self._fields[self._fields.index("gate") :]}


def new_state(datasheet: Datasheet, rolling: RollingFTest) -> StreamState:
    """State before the first sample; it shares the arrays of the rolling tests."""
    return StreamState(
        table=datasheet.table(),
        ranges=gate_ranges(datasheet),
        area_m2=datasheet.area_m2,
        frame=np.full(FIRST_PUMP + PUMP_VALUES * datasheet.pumps, math.nan),
        gate=new_gate(),
        pumps=new_pumps(datasheet),
        sampling_period=new_sampling_period(),
        steady_samples=new_steady_samples(),
        phases=new_phases(),
        stuck_sensors=new_stuck_sensors(datasheet.pumps),
        missing_signals=new_missing_signals(datasheet.pumps),
        windows=rolling.windows,
        moments=rolling.moments,
        counts=rolling.counts,
        sampling_steps=new_sampling_steps(),
        lacks_head=np.zeros(datasheet.pumps, dtype=np.int64),
    )
