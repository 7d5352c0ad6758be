"""Settings of the services. Order: defaults < TOML file < environment (`WETWELL_...`) < flags."""

import json
import os
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, IPvAnyNetwork, SecretStr, ValidationError
from pydantic_settings import BaseSettings, EnvSettingsSource, SettingsConfigDict

from wetwell.detector.dispatch import Costs
from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.protocols.registers import WordOrder
from wetwell.protocols.station import Positive, Table, load_toml
from wetwell.protocols.write_permission import LOOPBACK_WRITES

CONFIG_VARIABLE = "WETWELL_CONFIG"


class ZenohTlsSettings(Table):
    """Certificates of the bus, for endpoints `tls/...`; PEM files."""

    root_ca: Path | None = None
    certificate: Path | None = None
    private_key: Path | None = None
    mutual: bool = True
    verify_name: bool = True


class ZenohSettings(Table):
    """The bus: where; as whom (`user`); for a router whom it lets in (`users_file`) and to what (`access_control`).

    A password comes from `password_file`, or from the environment as `WETWELL_ZENOH__PASSWORD`.
    """

    endpoint: Annotated[str, Field(pattern=r"^(tcp|tls)/.+:\d+$")] = "tcp/127.0.0.1:7447"
    user: str | None = None
    password: SecretStr | None = None
    password_file: Path | None = None
    users_file: Path | None = None
    access_control: Path | Literal["default"] | None = None
    tls: ZenohTlsSettings = ZenohTlsSettings()


class ModbusTlsSettings(Table):
    """Certificates of the Modbus server, PEM: with them it speaks TLS only; with `client_ca` clients need one too."""

    certificate: Path | None = None
    private_key: Path | None = None
    client_ca: Path | None = None


class WriteRule(Table):
    """Registers that the clients of a network may write; `*` stands for any part of a name."""

    client: IPvAnyNetwork
    registers: Annotated[tuple[str, ...], Field(min_length=1)]


class ModbusSettings(Table):
    """The Modbus TCP server. Port 5020 needs no privilege, unlike the standard 502 (802 with TLS).

    `write_allow` says who may write; by default programs on this machine may, and nobody else.
    """

    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 5020
    unit_id: Annotated[int, Field(ge=1, le=247)] = 1
    word_order: WordOrder = "ABCD"
    tls: ModbusTlsSettings = ModbusTlsSettings()
    write_allow: tuple[WriteRule, ...] = tuple(
        WriteRule(client=one.client, registers=one.registers) for one in LOOPBACK_WRITES
    )


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


def secret_of(name: str, value: SecretStr | None, file: Path | None) -> str | None:
    """A secret that stands in the settings or, better, in a file of its own, without the end of the line.

    Raises
    ------
    ConfigError
        If both are given, or the file cannot be read or is empty. The secret itself is never in the message.
    """
    if value is not None and file is not None:
        raise ConfigError(f"{name} and {name}_file are both given: which one counts?")
    if file is None:
        return None if value is None else value.get_secret_value()
    try:
        secret = file.read_text().strip("\r\n")
    except (OSError, UnicodeError) as error:
        raise ConfigError(f"{name}_file: {file}: cannot be read: {error}") from error
    if not secret:
        raise ConfigError(f"{name}_file: {file} is empty")
    return secret


def for_child(table: Table) -> str:
    """A table as JSON for the environment of a child process, with the secrets that every other print masks."""
    return json.dumps(table.model_dump(), default=_plain)


def _plain(value: object) -> str:
    return value.get_secret_value() if isinstance(value, SecretStr) else str(value)


def _merged(*trees: dict[str, Any]) -> dict[str, Any]:
    """Trees laid over one another, the later ones on top."""
    merged: dict[str, Any] = {}
    for tree in trees:
        for key, value in tree.items():
            below = merged.get(key)
            merged[key] = _merged(below, value) if isinstance(below, dict) and isinstance(value, dict) else value
    return merged
