"""Station file: what the owner of a pump station knows of it, in TOML, checked to the last key."""

import math
import tomllib
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.protocols.station.curve_fit import fit_error_m, fit_pump_curve

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Fraction = Annotated[float, Field(gt=0, le=1)]
NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9_.-]*$"
"""A station's name is a chunk of a Zenoh key and of a file name."""

MAX_MISFIT = 0.1
"""Root mean square distance of datasheet points from their curve over its shut-off head, at the most."""


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


class Table(BaseModel):
    """Base of the tables of a TOML file: frozen, an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Sump(Table):
    """The wet well: an area, or a profile of points (level, area) with the area linear between them; an overflow."""

    area_m2: Positive
    profile: tuple[tuple[Finite, Positive], ...] | None = None
    overflow_level_m: Positive | None = None
    weir_width_m: Positive = 1.0

    @model_validator(mode="after")
    def _check_profile(self) -> Self:
        levels_m = [level_m for level_m, _ in self.profile or ()]
        if levels_m and (levels_m[0] != 0.0 or any(low >= high for low, high in pairwise(levels_m))):
            raise ValueError(f"profile: levels must rise from 0, got {levels_m}")
        if self.profile is not None and not levels_m:
            raise ValueError("profile: at least one point (level_m, area_m2) is needed")
        return self


class Pump(Table):
    """One pump: its curve at nominal speed, by coefficients or by datasheet points."""

    curve: tuple[Finite, Finite, Finite] | None = None
    points: tuple[tuple[NonNegative, Finite], ...] | None = None
    nominal_frequency_hz: Positive = 50.0

    @model_validator(mode="after")
    def _check_curve(self) -> Self:
        if (self.curve is None) == (self.points is None):
            raise ValueError("give either 'curve' or 'points'")
        c0, c1, c2 = self.coefficients
        if c0 <= 0:
            raise ValueError(f"curve: shut-off head c0 must be positive, got {c0:g} m")
        if c1 > 0 or c2 > 0 or c1 + c2 == 0:
            raise ValueError(f"curve: head must fall with flow (c1 <= 0, c2 <= 0), got c1 = {c1:g}, c2 = {c2:g}")
        misfit_m = fit_error_m(self.points, self.coefficients) if self.points else 0.0
        if misfit_m > MAX_MISFIT * c0:
            raise ValueError(
                f"points: the best falling curve misses them by {misfit_m:.3g} m, more than {MAX_MISFIT:.0%} of its "
                f"shut-off head of {c0:.3g} m; is a point [flow_m3h, head_m], and does the head fall?"
            )
        return self

    @cached_property
    def coefficients(self) -> tuple[float, float, float]:
        """(c0, c1, c2) of H = c0 N² + c1 N Q + c2 Q², Q in m³/h."""
        if self.curve is not None:
            return self.curve
        return fit_pump_curve(self.points or ())


class RisingMain(Table):
    """System curve H = static_head_m + friction_h2_m5 Q², Q in m³/h."""

    static_head_m: NonNegative = 2.0
    friction_h2_m5: NonNegative = 6.0e-4
    layout: Literal["individual", "common"] = "individual"


class Control(Table):
    """Start and stop by level, with ramps. Fewer levels than pumps: the others stand by in rotation.

    Mode "pid" starts and stops by the same levels, and holds `setpoint_m` by the speed of the running pumps.
    `max_starts_per_hour` is for each pump, 0 sets no limit; `out_of_service` counts pumps from 1.
    """

    mode: Literal["on_off", "pid"] = "on_off"
    start_levels_m: Annotated[tuple[Finite, ...], Field(min_length=1)] = (1.6, 1.8, 2.0)
    stop_levels_m: Annotated[tuple[Finite, ...], Field(min_length=1)] = (0.5, 0.8, 1.0)
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

    @model_validator(mode="after")
    def _check_levels(self) -> Self:
        check_levels(self.start_levels_m, self.stop_levels_m)
        return self


class Electrical(Table):
    """Motor and supply of every pump.

    Power model "current" is the paper's: the current follows the frequency; "load": it follows the shaft power.
    """

    voltage_v: Positive = 400.0
    rated_current_a: Positive = 30.0
    power_factor: Fraction = 0.9
    efficiency: Fraction = 0.9
    power_model: Literal["current", "load"] = "current"
    motor_efficiency: Fraction = 0.92
    drive_efficiency: Fraction = 0.97
    shutoff_power_share: Annotated[float, Field(ge=0, le=1)] = 0.4


class Sensors(Table):
    """Standard deviations of the measurements: relative, but for the level in metres.

    `correlation` is that of the noise from one second to the next.
    """

    flow_noise: NonNegative = 0.01
    head_noise: NonNegative = 0.01
    power_noise: NonNegative = 0.01
    inflow_noise: NonNegative = 0.01
    level_noise_m: NonNegative = 0.002
    correlation: Annotated[float, Field(ge=0, lt=1)] = 0.0


class EffectTable(BaseModel):
    """An effect beyond the plain model: its name, and parameters that the effect itself checks."""

    model_config = ConfigDict(frozen=True, extra="allow")
    name: str


class Station(Table):
    """A pump station. Pumps are in rotation order."""

    name: Annotated[str, Field(pattern=NAME_PATTERN, max_length=64)]
    sump: Sump
    pump: Annotated[tuple[Pump, ...], Field(min_length=1, max_length=32)]
    rising_main: RisingMain = RisingMain()
    control: Control = Control()
    electrical: Electrical = Electrical()
    sensors: Sensors = Sensors()
    effect: tuple[EffectTable, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _fit_default_levels(cls, data: Any) -> Any:
        """Without levels in the file, take as many of the default ones as there are pumps."""
        if not isinstance(data, dict) or not isinstance(data.get("pump"), list | tuple):
            return data
        control = data.get("control", {})
        if not isinstance(control, dict):
            return data
        defaults = {
            key: Control.model_fields[key].default[: len(data["pump"])]
            for key in ("start_levels_m", "stop_levels_m")
            if key not in control
        }
        if len(defaults) == 1 and len(data["pump"]) > 0:
            (key,) = defaults
            (other,) = {"start_levels_m", "stop_levels_m"} - {key}
            raise ValueError(f"control.{key}: missing, as {other} is given")
        return {**data, "control": {**control, **defaults}}

    @model_validator(mode="after")
    def _check_together(self) -> Self:
        levels, pumps = len(self.control.start_levels_m), len(self.pump)
        if levels > pumps:
            raise ValueError(f"control.start_levels_m: {levels} levels for {pumps} pumps, at most one a pump")
        absent = [number for number in self.control.out_of_service if number > pumps]
        if absent:
            raise ValueError(f"control.out_of_service: got {absent[0]}, there are {pumps} pumps")
        for number, pump in enumerate(self.pump, start=1):
            if pump.coefficients[0] <= self.rising_main.static_head_m:
                raise ValueError(
                    f"pump[{number}]: shut-off head {pump.coefficients[0]:g} m must exceed "
                    f"rising_main.static_head_m = {self.rising_main.static_head_m:g} m, or no water flows"
                )
            if self.control.min_frequency_hz >= pump.nominal_frequency_hz:
                raise ValueError(
                    f"control.min_frequency_hz: got {self.control.min_frequency_hz:g}, must lie under "
                    f"pump[{number}].nominal_frequency_hz = {pump.nominal_frequency_hz:g}"
                )
        return self


def load_toml(path: Path) -> dict[str, Any]:
    """Content of a TOML file.

    Raises
    ------
    ConfigError
        If the file cannot be read or is not TOML; names the file and the line.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not UTF-8 text") from error
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: is not TOML: {error}") from error


def load_station(path: Path) -> Station:
    """Station in a TOML file.

    Raises
    ------
    ConfigError
        If a rule is broken; one line with file, key, value and rule.
    """
    try:
        return Station.model_validate(load_toml(path))
    except ValidationError as error:
        raise ConfigError(f"{path}: {first_fault(error)}") from error
