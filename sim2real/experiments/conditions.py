"""Under what an act would be played: the inflow of these days, and what the station records."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.quantities import HAND_COLUMNS, PUMP_METERS, AnalogueQuantity, pump_column
from wetwell.protocols.recordings.origin import StoredValue
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.seconds import trailing_means
from wetwell.sim2real.recording.traces import Traces
from wetwell.simulator.duty import duty_flows_m3h
from wetwell.simulator.parameters import plant_parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """What is known of a station where an act is planned.

    Attributes
    ----------
    inflow_m3h : float
        Mean inflow. [m³/h]
    signals : tuple of str
        Quantities that the station records, beside frequencies.
    rate_s : float
        From row to row. [s]
    value : "instant", "mean" or "held"
        What a row stands for; held values are taken for instants.
    """

    inflow_m3h: float
    signals: tuple[AnalogueQuantity, ...]
    rate_s: float
    value: StoredValue

    def recorded(self, recording: Recording, pumps: int) -> Recording:
        """What of a recording of each second the station would store."""
        every = max(round(self.rate_s), 1)
        is_mean = self.value == "mean" and every > 1
        rows = np.arange(every - 1 if is_mean else 0, len(recording), every)
        of_pumps = [*(name for name in PUMP_METERS if name in self.signals), "frequency_hz"]
        kept = {*self.signals, *(pump_column(i + 1, name) for i in range(pumps) for name in of_pumps)}
        averaged = partial(trailing_means, span_s=every)
        columns: dict[str, Floats] = {
            name: (averaged(values) if is_mean and name in kept else values)[rows]
            for name, values in recording.columns.items()
            if name in kept or name in HAND_COLUMNS
        }
        return Recording(time_ns=recording.time_ns[rows], columns=columns, value="mean" if is_mean else "instant")


def conditions_of(traces: Traces, station: Station) -> Conditions:
    """Conditions of a recording.

    An inflow that is not measured is what the pumps carried at their duty, by the hours that they ran.
    """
    signals: list[AnalogueQuantity] = [name for name in PUMP_METERS if name in traces.signals]
    if np.isfinite(traces.level_m).any():
        signals.append("level_m")
    if traces.inflow_m3h is not None:
        signals.append("inflow_m3h")
    return Conditions(
        inflow_m3h=_mean_inflow_m3h(traces, station),
        signals=tuple(signals),
        rate_s=traces.rate_s,
        value=traces.value,
    )


def _mean_inflow_m3h(traces: Traces, station: Station) -> float:
    is_known = traces.is_row
    if traces.inflow_m3h is not None:
        return float(np.mean(traces.inflow_m3h[is_known]))
    plant = plant_parameters(station)
    alone = np.eye(traces.pumps)
    duty_m3h = np.array([duty_flows_m3h(plant, one, plant.rated_level_m)[i] for i, one in enumerate(alone)])
    share = np.mean(traces.frequency_hz[:, is_known] / plant.nominal_frequency_hz[:, None], axis=1)
    return float(share @ duty_m3h)
