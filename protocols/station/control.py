"""How a station starts and stops its pumps."""

import math
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from wetwell.protocols.station.table import Finite, NonNegative, Positive, Table

DEFAULT_START_LEVELS_M = (1.6, 1.8, 2.0)
DEFAULT_STOP_LEVELS_M = (0.5, 0.8, 1.0)
"""The paper's. [m]"""


def check_levels(start_levels_m: tuple[float, ...], stop_levels_m: tuple[float, ...]) -> None:
    """Refuse start and stop levels that cannot work together.

    Raises
    ------
    ValueError
        If the numbers of levels differ, a level is not finite, a stop level is not under its start level, or levels
        fall with n.
    """
    if len(start_levels_m) != len(stop_levels_m):
        raise ValueError(
            f"as many stop_levels_m as start_levels_m are needed, got {len(stop_levels_m)} and {len(start_levels_m)}"
        )
    for n, (start_m, stop_m) in enumerate(zip(start_levels_m, stop_levels_m, strict=True), start=1):
        if not (math.isfinite(start_m) and math.isfinite(stop_m)):
            raise ValueError(f"start and stop level {n} must be finite, got {start_m:g} and {stop_m:g}")
        if stop_m >= start_m:
            raise ValueError(f"stop_levels_m[{n}] = {stop_m:g} must lie under start_levels_m[{n}] = {start_m:g}")
    if sorted(start_levels_m) != list(start_levels_m) or sorted(stop_levels_m) != list(stop_levels_m):
        raise ValueError("start_levels_m and stop_levels_m must not fall from one pump to the next")


class Control(Table):
    """Start and stop by level, with ramps. Fewer levels than pumps: the others stand by in rotation.

    Parameters
    ----------
    mode : str
        "on_off"; "pid" starts and stops by the same levels, and holds `setpoint_m` by the speed of the running pumps;
        "external" has no levels: an optimiser or an operator starts and stops the pumps, and nobody knows why.
    start_levels_m, stop_levels_m : list of float
        Level at which the n-th pump starts, and at which the n-th running pump stops. [m]
    ramp_s : float
        Time from 0 Hz to nominal frequency, and back. [s]
    min_frequency_hz : float
        Under which a running pump is not driven; the nominal frequency where pumps have no drive. [Hz]
    dwell_s : float
        How long a pump stays at `min_frequency_hz` before it stops. [s]
    rotation : str
        Which pump starts next: the next in order, the first that stands, or the one that ran least.
    max_starts_per_hour : int
        Of each pump; 0 sets no limit. [1/h]
    out_of_service : list of int
        Pumps that are not started, counted from 1.
    setpoint_m : float
        Level that mode "pid" holds. [m]
    gain_hz_m : float
        Proportional gain of mode "pid". [Hz/m]
    integral_s, derivative_s : float
        Its integral and derivative time. [s]
    """

    mode: Literal["on_off", "pid", "external"] = "on_off"
    start_levels_m: tuple[Finite, ...] = DEFAULT_START_LEVELS_M
    stop_levels_m: tuple[Finite, ...] = DEFAULT_STOP_LEVELS_M
    ramp_s: Positive = 10.0
    min_frequency_hz: NonNegative = 0.0
    dwell_s: NonNegative = 0.0
    rotation: Literal["round_robin", "fixed", "least_run_time"] = "round_robin"
    max_starts_per_hour: Annotated[int, Field(ge=0, le=60)] = 0
    out_of_service: tuple[Annotated[int, Field(ge=1)], ...] = ()
    setpoint_m: Finite = 1.0
    gain_hz_m: Positive = 20.0
    integral_s: Positive = 120.0
    derivative_s: NonNegative = 0.0

    @model_validator(mode="before")
    @classmethod
    def _leave_out_levels(cls, data: Any) -> Any:
        """Of an external control take no level."""
        if not isinstance(data, dict) or data.get("mode") != "external":
            return data
        given = [key for key in ("start_levels_m", "stop_levels_m") if data.get(key)]
        if given:
            raise ValueError(f"{given[0]}: mode 'external' has no levels")
        return {**data, "start_levels_m": (), "stop_levels_m": ()}

    @model_validator(mode="after")
    def _check_levels(self) -> Self:
        if self.is_external:
            return self
        if not self.start_levels_m:
            raise ValueError("start_levels_m: at least one level is needed")
        check_levels(self.start_levels_m, self.stop_levels_m)
        return self

    @property
    def is_external(self) -> bool:
        """Whether nobody knows why pumps start and stop."""
        return self.mode == "external"
