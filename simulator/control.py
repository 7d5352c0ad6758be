"""Supervisory logic: start and stop pumps by the measured level, in rotation."""

import numpy as np
import numpy.typing as npt

from wetwell.simulator.jit import compiled

NOTHING = -1


@compiled
def next_in_rotation(rotation: int, is_commanded: npt.NDArray[np.bool_], is_automatic: npt.NDArray[np.bool_]) -> int:
    """Index of the pump that starts next: the first from `rotation` on that is automatic and idle, or -1."""
    pumps = is_commanded.size
    for step in range(pumps):
        pump = (rotation + step) % pumps
        if is_automatic[pump] and not is_commanded[pump]:
            return pump
    return NOTHING


@compiled
def wanted_change(
    measured_level_m: float,
    running: int,
    start_levels_m: npt.NDArray[np.float64],
    stop_levels_m: npt.NDArray[np.float64],
) -> int:
    r"""Start one pump (+1), stop one (-1) or leave all as they are (0).

    $$n^+ = n + 1 \text{ if } L \ge S_{n+1},\quad n - 1 \text{ if } L \le E_n,\quad n \text{ otherwise}$$

    Parameters
    ----------
    measured_level_m : float
        Level as the sensor gives it, with its noise. [m]
    running : int
        n, pumps commanded to run.
    start_levels_m, stop_levels_m : (n_max,) arrays
        S_n and E_n, with E_n < S_n. [m]

    References
    ----------
    .. [1] Eshkofti et al., Modeling and physics-enhanced fault detection in wastewater pump stations:
       common supervisory start and stop logic.
    """
    if running < start_levels_m.size and measured_level_m >= start_levels_m[running]:
        return 1
    if running > 0 and measured_level_m <= stop_levels_m[min(running, stop_levels_m.size) - 1]:
        return -1
    return 0
