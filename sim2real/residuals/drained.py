"""When a wet well is so low that what its pumps take is not what their curves say."""

import numpy as np

from wetwell.protocols.arrays import Flags
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.level_noise import level_noise_m
from wetwell.sim2real.replay.replay import Prediction

DRAINED_S = 2.0
"""Time in which the pumps could take all that is left: then they may draw air, as no two models of it agree. [s]"""
NOISES = 3.0
"""Standard deviations by which a level may read too high."""


def is_drained(traces: Traces, station: Station, plain: Prediction) -> Flags:
    """(n,) whether a recorded level leaves the pumps that run no more than `DRAINED_S` of their rated flow.

    Parameters
    ----------
    traces : Traces
    station : Station
    plain : Prediction
        Of the station as it is.
    """
    profile = plain.plant.profile
    left_m = traces.level_m - profile["level_m"][0] - NOISES * level_noise_m(traces, station)
    taken_m3h = plain.plant.rated_flow_m3h @ (traces.frequency_hz > 0.0)
    return np.asarray(left_m * profile["area_m2"][0] < taken_m3h / 3600.0 * DRAINED_S, dtype=np.bool_)
