"""Station file: what the owner of a pump station knows of it, in TOML, checked to the last key."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.protocols.station.control import DEFAULT_START_LEVELS_M, DEFAULT_STOP_LEVELS_M, Control
from wetwell.protocols.station.costs import Costs
from wetwell.protocols.station.limits import Limits
from wetwell.protocols.station.materiality import Materiality
from wetwell.protocols.station.pump import Pump
from wetwell.protocols.station.rising_main import RisingMain
from wetwell.protocols.station.sump import Sump
from wetwell.protocols.station.table import Fraction, Label, NonNegative, Positive, Table

NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9_.-]*$"
"""A station's name is a chunk of a Zenoh key and of a file name."""


class Electrical(Table):
    """Motor and supply of every pump.

    Parameters
    ----------
    voltage_v : float
        Between two phases of the supply. [V]
    rated_current_a : float
        That the motor takes at nominal frequency. [A]
    power_factor : float
        cos φ of the motor. [1]
    efficiency : float
        Of the pump without its motor at its rated duty, where the pump has no points of its own. [1]
    power_model : str
        "current", the paper's: the current follows the frequency; "load": it follows the shaft power.
    motor_efficiency, drive_efficiency : float
        At rated load, in power model "load". [1]
    shutoff_power_share : float
        Shaft power at no flow over the rated one, in power model "load". [1]
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

    Parameters
    ----------
    flow_noise, head_noise, power_noise, inflow_noise : float
        Standard deviation, as a share of the reading. [1]
    level_noise_m : float
        Standard deviation of the level. [m]
    correlation : float
        Of the noise from one second to the next. [1]
    """

    flow_noise: NonNegative = 0.01
    head_noise: NonNegative = 0.01
    power_noise: NonNegative = 0.01
    inflow_noise: NonNegative = 0.01
    level_noise_m: NonNegative = 0.002
    correlation: Annotated[float, Field(ge=0, lt=1)] = 0.0


class EffectTable(BaseModel):
    """An effect beyond the plain model.

    Parameters
    ----------
    name : str
        Which one; its parameters stand beside it, and the effect itself checks them.
    """

    model_config = ConfigDict(frozen=True, extra="allow")
    name: str


class Station(Table):
    """A pump station.

    A file has one `[rising_main]` or several `[[main]]`; code asks for `mains`, and for the main of each pump.

    Parameters
    ----------
    name : str
        Its key on the bus and in files.
    title : str, optional
        What people call it: `Pumpwerk Süd`. Tables and pages show it.
    pump : list of Pump
        The pumps, in the order in which they take turns.
    rising_main : RisingMain, optional
        The rising main, where there is one; else see `main`.
    main : list of RisingMain, optional
        Instead of `rising_main`, where there are several; each pump says which is its own.
    costs : Costs, optional
        What acts and omissions cost here; without it those of the settings count.
    effect : list of EffectTable
        What the plain model leaves out, such as a common header or a slow sensor.
    """

    name: Annotated[str, Field(pattern=NAME_PATTERN, max_length=64)]
    title: Label | None = None
    sump: Sump
    pump: Annotated[tuple[Pump, ...], Field(min_length=1, max_length=32)]
    rising_main: RisingMain | None = None
    main: Annotated[tuple[RisingMain, ...], Field(min_length=1)] | None = None
    control: Control = Control()
    electrical: Electrical = Electrical()
    sensors: Sensors = Sensors()
    materiality: Materiality = Materiality()
    limits: Limits = Limits()
    costs: Costs | None = None
    effect: tuple[EffectTable, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _fill_defaults(cls, data: Any) -> Any:
        """Without a main in the file take the default one; without levels, as many of them as there are pumps."""
        if not isinstance(data, dict):
            return data
        if data.get("rising_main") is data.get("main") is None:
            data = {**data, "rising_main": RisingMain()}
        control = data.get("control", {})
        if not isinstance(data.get("pump"), list | tuple) or not isinstance(control, dict):
            return data
        if control.get("mode") == "external":
            return data
        defaults = {
            key: levels_m[: len(data["pump"])]
            for key, levels_m in (
                ("start_levels_m", DEFAULT_START_LEVELS_M),
                ("stop_levels_m", DEFAULT_STOP_LEVELS_M),
            )
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
        check_names(self.pump_names, "pump")
        self._check_mains()
        for number, pump in enumerate(self.pump, start=1):
            self._check_pump(number, pump)
        return self

    def _check_mains(self) -> None:
        if self.rising_main is not None and self.main is not None:
            raise ValueError("main: give either [rising_main] or [[main]]")
        names = [main.name for main in self.main or ()]
        if None in names:
            raise ValueError(f"main[{names.index(None) + 1}].name: missing")
        check_names(names, "main")
        known = [main.name for main in self.mains if main.name is not None]
        told = f"there are {', '.join(map(repr, known))}" if known else "no main has a name"
        for number, pump in enumerate(self.pump, start=1):
            if pump.main is None and len(self.mains) > 1:
                raise ValueError(f"pump[{number}].main: missing, {told}")
            if pump.main is not None and pump.main not in known:
                raise ValueError(f"pump[{number}].main: got {pump.main!r}, {told}")
        idle = sorted(set(range(len(self.mains))) - set(self.main_of_pump))
        if idle:
            raise ValueError(f"main[{idle[0] + 1}]: no pump has main = {names[idle[0]]!r}")

    def _check_pump(self, number: int, pump: Pump) -> None:
        main = self.mains[self.main_of_pump[number - 1]]
        place = "rising_main" if self.main is None else f"main[{self.main_of_pump[number - 1] + 1}]"
        if pump.coefficients[0] <= main.static_head_at_m(self.middle_level_m):
            lift = (
                f"{place}.static_head_m = {main.lift_at_zero_m:g} m"
                if main.delivery_level_m is None
                else f"{place}.delivery_level_m = {main.delivery_level_m:g} less a level of {self.middle_level_m:g} m"
            )
            raise ValueError(
                f"pump[{number}]: shut-off head {pump.coefficients[0]:g} m must exceed {lift}, or no water flows"
            )
        if self.control.min_frequency_hz > pump.nominal_frequency_hz:
            raise ValueError(
                f"control.min_frequency_hz: got {self.control.min_frequency_hz:g}, must not exceed "
                f"pump[{number}].nominal_frequency_hz = {pump.nominal_frequency_hz:g}"
            )
        key = "power_points" if pump.power_points is not None else "efficiency_points"
        if getattr(pump, key) is not None and self.electrical.power_model != "load":
            raise ValueError(f"pump[{number}].{key}: electrical.power_model must be 'load', or they mean nothing")

    @property
    def mains(self) -> tuple[RisingMain, ...]:
        """Rising mains, at least one."""
        return self.main or (self.rising_main or RisingMain(),)

    @property
    def main_of_pump(self) -> tuple[int, ...]:
        """Place of each pump's main in `mains`, from 0."""
        places = {main.name: place for place, main in enumerate(self.mains)}
        return tuple(places.get(pump.main, 0) for pump in self.pump)

    def pumps_of_main(self, main: int) -> list[int]:
        """Pumps of a main, all from 0."""
        return [pump for pump, its_main in enumerate(self.main_of_pump) if its_main == main]

    @property
    def pump_names(self) -> tuple[str, ...]:
        """What people call the pumps; a number where the file has no name."""
        return tuple(pump.name or str(number) for number, pump in enumerate(self.pump, start=1))

    @property
    def label(self) -> str:
        """Key of the station, and beside it what people call it: `sued (Pumpwerk Süd)`."""
        return self.name if self.title is None else f"{self.name} ({self.title})"

    @property
    def pump_labels(self) -> tuple[str, ...]:
        """What people call the pumps, with the title of the station where it has one: `Pumpwerk Süd 3`."""
        return tuple(name if self.title is None else f"{self.title} {name}" for name in self.pump_names)

    @property
    def middle_level_m(self) -> float:
        """Level at which rated duties are told: between first stop and start level, or that of the sump. [m]."""
        if self.control.is_external:
            return self.sump.middle_level_m
        return 0.5 * (self.control.start_levels_m[0] + self.control.stop_levels_m[0])

    def with_mains(self, mains: Sequence[RisingMain]) -> Self:
        """The same station with other values of its mains, as many as before; checked.

        Raises
        ------
        ValueError
            If a rule is broken; also pydantic's.
        """
        table = {"rising_main": mains[0]} if self.main is None else {"main": tuple(mains)}
        return type(self).model_validate(self.model_dump(exclude_none=True) | table)


def check_names(names: Sequence[str | None], what: str) -> None:
    """Refuse two equal names.

    Raises
    ------
    ValueError
        Names both places.

    Examples
    --------
    >>> check_names(["1", "1"], "pump")
    Traceback (most recent call last):
    ...
    ValueError: pump[2].name: '1' is that of pump[1] already
    """
    for number, name in enumerate(names, start=1):
        if (first := names.index(name) + 1) < number:
            raise ValueError(f"{what}[{number}].name: {name!r} is that of {what}[{first}] already")


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
    except RecursionError as error:
        raise ConfigError(f"{path}: is nested too deeply") from error


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
