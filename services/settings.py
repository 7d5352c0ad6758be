"""Settings of the services. Order: defaults < TOML file < environment (`WETWELL_...`) < flags."""

import json
import os
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, SecretStr, ValidationError, model_validator
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


class HistorianSettings(Table):
    """The historian: where it keeps what, and for how long.

    `url` names a PostgreSQL database that is used in place of the folder, such as `postgresql://user@host/name`; its
    password may stand in `password_file`. Days count back from the newest sample of a station. A batch is kept each
    `commit_s`; up to `spool_rows` wait in memory while the disk or the database refuses.
    """

    folder: Path = Path("wetwell-data")
    url: SecretStr | None = None
    password_file: Path | None = None
    commit_s: Positive = 1.0
    maintain_s: Positive = 60.0
    spool_rows: Annotated[int, Field(ge=1)] = 500_000
    keep_live_days: Annotated[int, Field(ge=1)] = 1
    downsample_after_days: Annotated[int, Field(ge=2)] | None = None
    keep_days: Annotated[int, Field(ge=2)] | None = None

    @model_validator(mode="after")
    def _days_rise(self) -> Self:
        days = [self.keep_live_days, self.downsample_after_days, self.keep_days]
        given = [each for each in days if each is not None]
        if any(later <= earlier for earlier, later in pairwise(given)):
            raise ValueError("keep_live_days < downsample_after_days < keep_days must hold")
        return self

    def for_child(self) -> str:
        """As JSON for the environment of a child process, with the secret that `model_dump_json` masks."""
        url = None if self.url is None else self.url.get_secret_value()
        return json.dumps(self.model_dump(mode="json") | {"url": url})


class Settings(BaseSettings):
    """All settings of a service."""

    model_config = SettingsConfigDict(env_prefix="WETWELL_", env_nested_delimiter="__", extra="forbid", frozen=True)

    zenoh: ZenohSettings = ZenohSettings()
    modbus: ModbusSettings = ModbusSettings()
    log: LogSettings = LogSettings()
    health: HealthSettings = HealthSettings()
    detector: DetectorSettings = DetectorSettings()
    historian: HistorianSettings = HistorianSettings()


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
