"""Settings of the services. Order: defaults < TOML file < environment (`WETWELL_...`) < flags."""

import json
import os
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, IPvAnyNetwork, SecretStr, ValidationError, model_validator
from pydantic_settings import BaseSettings, EnvSettingsSource, SettingsConfigDict

from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.protocols.messages.alarm import Priority, RuleName
from wetwell.protocols.modbus.registers import WordOrder
from wetwell.protocols.modbus.write_permission import LOOPBACK_WRITES
from wetwell.protocols.station.costs import Costs
from wetwell.protocols.station.station_file import load_toml
from wetwell.protocols.station.table import Finite, NonNegative, Positive, Table

Endpoint = Annotated[str, Field(pattern=r"^(tcp|tls)/.+:\d+$")]

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

    `upstream`: routers that a router connects to, as a branch of their tree. `gather_s`: so long gateway, simulator
    and replay gather the samples of a station into one message; with 0 each is sent at once, by itself.

    A password comes from `password_file`, or from the environment as `WETWELL_ZENOH__PASSWORD`.
    """

    endpoint: Endpoint = "tcp/127.0.0.1:7447"
    upstream: tuple[Endpoint, ...] = ()
    gather_s: Annotated[float, Field(ge=0.0, le=30.0)] = 0.0
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
    """Logs, on standard error. Form "json" is one JSON object a line."""

    level: Literal["DEBUG", "INFO", "WARNING", "ERROR"] = "INFO"
    form: Literal["text", "json"] = "text"


class HealthSettings(Table):
    """Health figures on the bus, and over HTTP at an address such as `127.0.0.1:9100` where one is given.

    `max_sample_age_s`: so long without a sample, and `/healthz` says that the daemon does not do its duty.
    """

    period_s: Positive = 10.0
    http: Annotated[str, Field(pattern=r"^.+:\d{1,5}$")] | None = None
    max_sample_age_s: Positive = 60.0


class DetectorSettings(Table):
    """The detector: where it keeps its state, if anywhere, how often, and what acts cost.

    `crash_tries`: so often within `crash_window_s` a station may bring the process down until it is left out.
    """

    state_dir: Path | None = None
    checkpoint_s: Positive = 60.0
    crash_tries: Annotated[int, Field(ge=1)] = 3
    crash_window_s: Positive = 86_400.0
    costs: Costs = Costs()


class RuleSettings(Table):
    """What is other than in the rule table for one kind of alarm."""

    priority: Priority | None = None
    on_delay_s: NonNegative | None = None
    off_delay_s: NonNegative | None = None
    is_enabled: bool | None = None
    is_latching: bool | None = None


class AlarmSettings(Table):
    """Alarms.

    Attributes
    ----------
    state_dir : Path, optional
        Folder of state and audit; without it acts are only logged and the state ends with the process.
    stale_after_s, silent_after_s : float
        Without a sample, and without a service, for so long on the wall clock is an alarm.
    heartbeat_after_s : float
        A heartbeat of a PLC that has not changed for so long is an alarm.
    high_level_m : float, optional
        High level of every station; without it, `high_level_margin_m` above the last start level of its file.
    overflow_margin_m : float
        So far under the overflow of the station file begins the risk.
    level_deadband_m : float
        So far under its limit must a level fall for the alarm to return.
    chattering_transitions : int
        More changes within an hour than these put an alarm on the chattering list.
    rules : dict
        By name of the rule, what is other than in the rule table.
    """

    state_dir: Path | None = None
    stale_after_s: Positive = 60.0
    silent_after_s: Positive = 30.0
    heartbeat_after_s: Positive = 30.0
    high_level_m: Finite | None = None
    high_level_margin_m: NonNegative = 0.3
    overflow_margin_m: NonNegative = 0.1
    level_deadband_m: NonNegative = 0.05
    chattering_transitions: Annotated[int, Field(ge=1)] = 10
    rules: dict[RuleName, RuleSettings] = Field(default_factory=dict)


class WatchSettings(Table):
    """The watch of the gap: where it keeps its state, if anywhere, and how often it asks what was kept meanwhile.

    `threads`: stations that are looked at side by side. `fleet_prior`: whether a station that is diagnosed takes what
    the others have shown as its prior.
    """

    state_dir: Path | None = None
    ask_s: Positive = 60.0
    threads: Annotated[int, Field(ge=1)] = 1
    fleet_prior: bool = False


class HistorianSettings(Table):
    """The historian: where it keeps what, and for how long.

    `url` names a PostgreSQL database that is used in place of the folder, such as `postgresql://user@host/name`; its
    password may stand in `password_file`. Days count back from the newest sample of a station. A batch is kept each
    `commit_s`; up to `spool_rows` samples and messages wait in memory while the disk or the database refuses.
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


class SecuritySettings(Table):
    """Who is let in: tokens of the dashboard, made by `wetwell token`; whether to listen to all without asking."""

    tokens_file: Path | None = None
    insecure: bool = False


class GatewaySettings(Table):
    """The gateway: files of the PLCs that it polls, and its longest wait before a connection is made anew."""

    plcs: tuple[Path, ...] = ()
    longest_wait_s: Positive = 30.0


class FleetSettings(Table):
    """Many stations on Dask: the scheduler, or how many workers to start here; shards; how often to look around."""

    scheduler: Annotated[str, Field(pattern=r"^(tcp|tls)://.+:\d+$")] | None = None
    workers: Annotated[int, Field(ge=1)] | None = None
    shards: Annotated[int, Field(ge=1, le=10_000)] = 8
    period_s: Positive = 2.0


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


class Settings(BaseSettings):
    """All settings of a service."""

    model_config = SettingsConfigDict(env_prefix="WETWELL_", env_nested_delimiter="__", extra="forbid", frozen=True)

    zenoh: ZenohSettings = ZenohSettings()
    modbus: ModbusSettings = ModbusSettings()
    log: LogSettings = LogSettings()
    health: HealthSettings = HealthSettings()
    detector: DetectorSettings = DetectorSettings()
    alarms: AlarmSettings = AlarmSettings()
    watch: WatchSettings = WatchSettings()
    historian: HistorianSettings = HistorianSettings()
    security: SecuritySettings = SecuritySettings()
    gateway: GatewaySettings = GatewaySettings()
    fleet: FleetSettings = FleetSettings()
    dashboard: DashboardSettings = DashboardSettings()


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


def environment_of(settings: Settings) -> dict[str, str]:
    """Variables that give a child process the same settings, with the secrets that every other print masks."""
    return {
        f"WETWELL_{section.upper()}": json.dumps(getattr(settings, section).model_dump(), default=_plain)
        for section in Settings.model_fields
    }


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
