"""Mass balance of the wet well."""

import numpy as np
import numpy.typing as npt

from wetwell.simulator.jit import compiled

SECONDS_PER_HOUR = 3600.0


@compiled
def next_level_m(level_m: float, inflow_m3h: float, flow_m3h: npt.NDArray[np.float64], area_m2: float) -> float:
    r"""Level one second later.

    $$A \frac{dL}{dt} = Q_{in} - \sum_i Q_i$$

    An explicit step: the flows are those of the second's beginning. Where the pumps would take more than there is,
    the flows are reduced in place, all by the same factor, so that the wet well runs dry and no water is invented.

    Parameters
    ----------
    level_m : float
        Level above the floor, >= 0. [m]
    inflow_m3h : float
        [m³/h]
    flow_m3h : (pumps,) array
        Flows out; reduced in place where the wet well runs dry. [m³/h]
    area_m2 : float
        [m²]

    Returns
    -------
    level_m : float
        [m]

    Examples
    --------
    >>> next_level_m(1.0, 36.0, np.array([0.0]), 1.0)
    1.01
    >>> flow_m3h = np.array([72.0])
    >>> next_level_m(0.01, 0.0, flow_m3h, 1.0), flow_m3h
    (0.0, array([36.]))
    """
    outflow_m3h = float(flow_m3h.sum())
    rise_m = (inflow_m3h - outflow_m3h) / (SECONDS_PER_HOUR * area_m2)
    if level_m + rise_m >= 0.0:
        return level_m + rise_m
    available_m3h = level_m * area_m2 * SECONDS_PER_HOUR + inflow_m3h
    flow_m3h *= available_m3h / outflow_m3h
    return 0.0
