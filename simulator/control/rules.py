"""Supervisory logic: start and stop pumps by the measured level, in rotation, or hold the level by their speed."""

from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import compiled
from wetwell.simulator.parameters import LEAST_RUN_TIME, ROUND_ROBIN
from wetwell.simulator.records import Records
from wetwell.simulator.state import PumpState, StationState

NOTHING = -1


@compiled
def next_in_rotation(rotation: int, turn: int, pumps: Records[PumpState]) -> int:
    """Index of the pump that starts next, or -1 if none is ready.

    Parameters
    ----------
    rotation : int
        `ROUND_ROBIN`: the first ready one from `turn` on; `FIXED`: the first ready one; `LEAST_RUN_TIME`: the ready
        one that has run least.
    turn : int
        Pump after the one that started last.
    pumps : records
        How long each has run, and whether it is ready: automatic, standing, and not started too often.
    """
    best = NOTHING
    for step in range(pumps.size):
        pump = (turn + step) % pumps.size if rotation == ROUND_ROBIN else step
        if not pumps[pump].is_ready:
            continue
        if best == NOTHING or (rotation == LEAST_RUN_TIME and pumps[pump].run_s < pumps[best].run_s):
            best = pump
        if rotation != LEAST_RUN_TIME:
            break
    return best


@compiled
def wanted_change(measured_level_m: float, running: int, start_levels_m: Floats, stop_levels_m: Floats) -> int:
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


@compiled
def controlled_frequency_hz(
    measured_level_m: float,
    setpoint_m: float,
    gain_hz_m: float,
    integral_s: float,
    derivative_s: float,
    minimum_hz: float,
    nominal_hz: float,
    memory: StationState,
) -> float:
    r"""Frequency by which running pumps hold the level: a PID controller.

    $$f = f_n + K \left(e + \frac{1}{T_i} \int e\, dt + T_d \frac{dL}{dt}\right), \qquad e = L - L_\text{set}$$

    limited to [minimum, nominal]. The integral stands while the limit holds the output and the error would push it
    further (anti-windup by conditional integration).

    Parameters
    ----------
    measured_level_m, setpoint_m : float
        [m]
    gain_hz_m, integral_s, derivative_s : float
        K, T_i, T_d. [Hz/m, s, s]
    minimum_hz, nominal_hz : float
        Limits. [Hz]
    memory : record
        Integral part, last level, and whether there is one; changed in place.

    References
    ----------
    .. [1] K. J. Åström, T. Hägglund, Advanced PID Control, ISA 2006: conditional integration.
    """
    error_m = measured_level_m - setpoint_m
    slope_m_s = measured_level_m - memory.pid_level_m if memory.has_pid_level else 0.0
    memory.pid_level_m = measured_level_m
    memory.has_pid_level = True
    integral_hz = memory.pid_integral_hz + gain_hz_m * error_m / integral_s
    wanted_hz = nominal_hz + gain_hz_m * (error_m + derivative_s * slope_m_s) + integral_hz
    if minimum_hz < wanted_hz < nominal_hz or (wanted_hz >= nominal_hz) == (error_m < 0.0):
        memory.pid_integral_hz = integral_hz
    return min(max(wanted_hz, minimum_hz), nominal_hz)
