"""Station file: what the owner of a pump station knows of it, in TOML, checked to the last key."""

import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.protocols.station.control import Control
from wetwell.protocols.station.pump import Pump
from wetwell.protocols.station.rising_main import RisingMain
from wetwell.protocols.station.sump import Sump
from wetwell.protocols.station.table import Fraction, NonNegative, Positive, Table

NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9_.-]*$"
"""A station's name is a chunk of a Zenoh key and of a file name."""


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
