"""The one flow meter in the main of several pumps: its flow is that of a pump while no other of them runs.

What it says of each pump while several run nobody knows: these have no value then.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.quantities import pump_column

RUN_QUANTITIES = ("running", "frequency_hz")
"""What tells whether a pump runs, the surer one first."""

_MAIN_FLOW = re.compile(r"main[1-9]\d*_flow_m3h")


def is_main_flow(name: str) -> bool:
    """Whether a signal is the flow of a main.

    Examples
    --------
    >>> is_main_flow("main2_flow_m3h"), is_main_flow("main0_flow_m3h"), is_main_flow("pump1_flow_m3h")
    (True, False, False)
    """
    return _MAIN_FLOW.fullmatch(name) is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class HandedOut:
    """Flow of a main as that of its pumps, and what became of the values of its meter.

    Attributes
    ----------
    flow_m3h : dict of pump to (rows,) float64
        By the number of the pump; NaN is "no value". [m³/h]
    one_runs : int
        Values that are the flow of the only pump that ran.
    several_run : int
        Values that are of no pump, as several ran.
    unknown : int
        Values that are of no pump, as it is not known which ran.
    none_runs : int
        Values that are of no pump, as none ran.
    high_m3h : float
        Highest of these last; NaN if there are none. [m³/h]
    """

    flow_m3h: dict[int, Floats]
    one_runs: int
    several_run: int
    unknown: int
    none_runs: int
    high_m3h: float


def hand_out(main_m3h: Floats, runs: Mapping[int, Floats]) -> HandedOut:
    """Hand the flow of a main to its pumps.

    A pump that stands has none: 0, whatever the meter says, as of water that still moves. A mean is that of the
    interval for the main and for the pump alike: a pump that ran in a part of it counts as one that runs.

    Parameters
    ----------
    main_m3h : (rows,) float64
        NaN is "no value". [m³/h]
    runs : mapping of pump to (rows,) float64
        Of all pumps of the main: 1 runs, 0 stands, NaN unknown, as of `runs_of`.

    Examples
    --------
    >>> runs = {1: np.array([1.0, 1.0, 0.0, 1.0]), 2: np.array([0.0, 1.0, 0.0, np.nan])}
    >>> done = hand_out(np.array([90.0, 130.0, 4.0, 91.0]), runs)
    >>> done.flow_m3h[1], done.flow_m3h[2], done.several_run, done.high_m3h
    (array([90., nan,  0., nan]), array([ 0., nan,  0., nan]), 1, 4.0)
    """
    state = np.array(list(runs.values()))
    running, unknown = np.sum(state == 1.0, axis=0), np.sum(np.isnan(state), axis=0)
    is_one = (running == 1) & (unknown == 0)
    is_none = (running == 0) & (unknown == 0)
    is_read = np.isfinite(main_m3h)
    of_runner = np.where(is_one, main_m3h, np.nan)
    idle_m3h = main_m3h[is_none & is_read]
    return HandedOut(
        flow_m3h={pump: np.where(states == 0.0, 0.0, of_runner) for pump, states in runs.items()},
        one_runs=int(np.sum(is_one & is_read)),
        several_run=int(np.sum((running > 1) & is_read)),
        unknown=int(np.sum((running < 2) & (unknown > 0) & is_read)),
        none_runs=idle_m3h.size,
        high_m3h=float(idle_m3h.max()) if idle_m3h.size else float("nan"),
    )


def runs_of(columns: Mapping[str, Floats], pumps: Sequence[int], rows: int) -> dict[int, Floats]:
    """Whether each pump runs in each row: by its running flag, where that has no value by its frequency.

    Parameters
    ----------
    columns : mapping of name to (rows,) float64
        Of a recording; a share of the interval in its flag, and any frequency above 0, is a pump that runs.
    pumps : sequence of int
        Numbers from 1.
    rows : int

    Returns
    -------
    dict of pump to (rows,) float64
        1 runs, 0 stands, NaN unknown.
    """
    runs: dict[int, Floats] = {}
    for pump in pumps:
        state = np.full(rows, np.nan)
        for quantity in RUN_QUANTITIES:
            values = columns.get(pump_column(pump, quantity))
            if values is not None:
                said = np.where(np.isfinite(values), values > 0.0, np.nan)
                state = np.where(np.isnan(state), said, state)
        runs[pump] = state
    return runs
