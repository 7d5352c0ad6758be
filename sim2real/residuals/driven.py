"""When a pump stands, or water drives it: it does no work, and no two meters of its head say the same."""

import numpy as np

from wetwell.protocols.arrays import Flags
from wetwell.sim2real.recording.regimes import STEADY, Regimes
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.replay import Prediction
from wetwell.simulator.hydraulics import flow_at_head_m3h


def does_work(traces: Traces, regimes: Regimes, plain: Prediction) -> Flags:
    """(pumps, n) whether a pump turns, and carries less than it does without any head.

    A long main keeps its water moving behind a pump that is stopped. One meter says then that the head is negative,
    one that it is nothing, and one what a drift leaves of nothing. The flow counts by its usual ratio to what is
    expected: a meter with another gain drives no pump.

    Parameters
    ----------
    traces : Traces
    regimes : Regimes
    plain : Prediction
        Of the station as it is.
    """
    turns = traces.frequency_hz > 0.0
    if "flow_m3h" not in traces.signals:
        return turns
    flow_m3h, expected_m3h = traces.signals["flow_m3h"], plain.signals["flow_m3h"]
    is_usual = (regimes.of_pumps == STEADY) & (flow_m3h > 0.0) & (expected_m3h > 0.0)
    usual = [
        np.median(expected[rows] / flow[rows]) if rows.any() else 1.0
        for flow, expected, rows in zip(flow_m3h, expected_m3h, is_usual, strict=True)
    ]
    without_head_m3h = [flow_at_head_m3h(p.c0, p.c1, p.c2, 1.0, 0.0, 0.0, 0.0) for p in plain.plant.pumps]
    speed_ratio = traces.frequency_hz / plain.plant.nominal_frequency_hz[:, None]
    is_driven = flow_m3h * np.array(usual)[:, None] > speed_ratio * np.array(without_head_m3h)[:, None]
    return np.asarray(turns & ~is_driven, dtype=np.bool_)
