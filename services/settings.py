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
    """The detector: where it keeps its state, if anywhere, and what acts cost."""

    state_dir: Path | None = None
    checkpoint_s: Positive = 60.0
    costs: Costs = Costs()


class DashboardSettings(Table):
    """The control-room page.

    Attributes
    ----------
    host, port
        Where it listens; beyond this machine only with `security.tokens_file`.
    reports : Path
        Folder whose `*.html`, three levels down, the page lists.
    stale_s : float
        Without a sample for so long, a station has no data. [s]
    """

    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8080
    reports: Path | None = None
    stale_s: Positive = 10.0


class SecuritySettings(Table):
    """Who is let in: tokens of the dashboard, made by `wetwell token`; whether to listen to all without asking."""

    tokens_file: Path | None = None
    insecure: bool = False


class Settings(BaseSettings):
    """All settings of a service."""

    model_config = SettingsConfigDict(env_prefix="WETWELL_", env_nested_delimiter="__", extra="forbid", frozen=True)

    zenoh: ZenohSettings = ZenohSettings()
    modbus: ModbusSettings = ModbusSettings()
    log: LogSettings = LogSettings()
    health: HealthSettings = HealthSettings()
    detector: DetectorSettings = DetectorSettings()
    dashboard: DashboardSettings = DashboardSettings()
    security: SecuritySettings = SecuritySettings()


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
