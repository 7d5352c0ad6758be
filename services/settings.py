"""Settings of the services. Order: defaults < TOML file < environment (`WETWELL_...`) < flags."""

import os
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError
from pydantic_settings import BaseSettings, EnvSettingsSource, SettingsConfigDict

from wetwell.detector.dispatch import Costs
from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.protocols.registers import WordOrder
from wetwell.protocols.station import Positive, Table, load_toml

CONFIG_VARIABLE = "WETWELL_CONFIG"


class ZenohSettings(Table):
    """The bus."""

    endpoint: Annotated[str, Field(pattern=r"^(tcp|tls)/.+:\d+$")] = "tcp/127.0.0.1:7447"


class ModbusSettings(Table):
    """The Modbus TCP server. Port 5020 needs no privilege, unlike the standard 502."""

    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 5020
    unit_id: Annotated[int, Field(ge=1, le=247)] = 1
    word_order: WordOrder = "ABCD"


class LogSettings(Table):
    """Logs, on standard error."""

    level: Literal["DEBUG", "INFO", "WARNING", "ERROR"] = "INFO"


class HealthSettings(Table):
    """Health figures on the bus."""

    period_s: Positive = 10.0


class DetectorSettings(Table):
    """The detector: where it keeps its state, if anywhere, how often, and what acts cost.

    `crash_tries`: so often a station may bring the process down until it is left out.
    """

    state_dir: Path | None = None
    checkpoint_s: Positive = 60.0
    crash_tries: Annotated[int, Field(ge=1)] = 3
    costs: Costs = Costs()


class FleetSettings(Table):
    """Many stations on Dask: the scheduler, or how many workers to start here; shards; how often to look around."""

    scheduler: Annotated[str, Field(pattern=r"^(tcp|tls)://.+:\d+$")] | None = None
    workers: Annotated[int, Field(ge=1)] | None = None
    shards: Annotated[int, Field(ge=1, le=10_000)] = 8
    period_s: Positive = 2.0


class Settings(BaseSettings):
    """All settings of a service."""

    model_config = SettingsConfigDict(env_prefix="WETWELL_", env_nested_delimiter="__", extra="forbid", frozen=True)

    zenoh: ZenohSettings = ZenohSettings()
    modbus: ModbusSettings = ModbusSettings()
    log: LogSettings = LogSettings()
    health: HealthSettings = HealthSettings()
    detector: DetectorSettings = DetectorSettings()
    fleet: FleetSettings = FleetSettings()


def load_settings(path: Path | None = None, flags: dict[str, Any] | None = None) -> Settings:
    """Settings from defaults, file, environment and flags.

    Parameters
    ----------
    path : Path, optional
        TOML file; without it the one that `WETWELL_CONFIG` names, if any.
    flags : dict, optional
        Tree of what the command line gives, without what it leaves open.

    Raises
    ------
    ConfigError
        If a rule is broken; one line with place, key, value and rule.
    """
    if path is None and os.environ.get(CONFIG_VARIABLE):
        path = Path(os.environ[CONFIG_VARIABLE])
    table = load_toml(path) if path is not None else {}
    try:
        environment = EnvSettingsSource(Settings)()
        return Settings(**_merged(table, environment, flags or {}))
    except ValidationError as error:
        place = path if path is not None else "settings"
        raise ConfigError(f"{place}: {first_fault(error)}") from error


def _merged(*trees: dict[str, Any]) -> dict[str, Any]:
    """Trees laid over one another, the later ones on top."""
    merged: dict[str, Any] = {}
    for tree in trees:
        for key, value in tree.items():
            below = merged.get(key)
            merged[key] = _merged(below, value) if isinstance(below, dict) and isinstance(value, dict) else value
    return merged
