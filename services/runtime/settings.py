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
from wetwell.protocols.station.station_file import NAME_PATTERN, load_toml
from wetwell.protocols.station.table import Finite, NonNegative, Positive, Table

Endpoint = Annotated[str, Field(pattern=r"^(tcp|tls)/.+:\d+$")]

CONFIG_VARIABLE = "WETWELL_CONFIG"


class ZenohTlsSettings(Table):
    """Certificates of the bus, for endpoints `tls/...`; PEM files.

    Parameters
    ----------
    root_ca : Path, optional
        Authority that must have signed the certificate of the other side.
    certificate, private_key : Path, optional
        Own certificate and its key.
    mutual : bool
        Whether a router lets in only clients that show a certificate.
    verify_name : bool
        Whether the certificate of the router must be for the name that was called.
    """

    root_ca: Path | None = None
    certificate: Path | None = None
    private_key: Path | None = None
    mutual: bool = True
    verify_name: bool = True


class ZenohSettings(Table):
    """The bus: where it is, as whom one comes, and whom a router lets in.

    Parameters
    ----------
    endpoint : str
        Address of the router, `tcp/host:port` or `tls/host:port`.
    upstream : list of str
        Routers that a router connects to, as a branch of their tree.
    gather_s : float
        So long gateway, simulator and replay gather the samples of a station into one message; with 0 each is sent at
        once, by itself. [s]
    user : str, optional
        Name under which one comes to the router.
    password : str, optional
        Of the user; better in `password_file`, or in the environment as `WETWELL_ZENOH__PASSWORD`.
    password_file : Path, optional
        File with the password alone.
    users_file : Path, optional
        Of a router: file of the users whom it lets in, with their passwords.
    access_control : Path or "default", optional
        Of a router: which user may send and receive what.
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
    """Certificates of the Modbus server, PEM files; with them it speaks TLS only.

    Parameters
    ----------
    certificate, private_key : Path, optional
        Own certificate and its key.
    client_ca : Path, optional
        Authority that must have signed the certificate of each client; without it clients need none.
    """

    certificate: Path | None = None
    private_key: Path | None = None
    client_ca: Path | None = None


class WriteRule(Table):
    """Registers that the clients of a network may write.

    Parameters
    ----------
    client : str
        Network or address of the clients.
    registers : list of str
        Names of registers; `*` stands for any part of a name.
    """

    client: IPvAnyNetwork
    registers: Annotated[tuple[str, ...], Field(min_length=1)]


class ModbusSettings(Table):
    """The Modbus TCP server.

    Parameters
    ----------
    host : str
        Address on which it listens.
    port : int
        Where it listens: 5020 needs no privilege, unlike the standard 502 (802 with TLS); 0 takes a free one.
    unit_id : int
        Unit id of the station.
    word_order : str
        Order of the four bytes of a 32-bit value, A being the highest.
    write_allow : list of WriteRule
        Who may write; by default programs on this machine may, and nobody else.
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
    """Logs, on standard error.

    Parameters
    ----------
    level : str
        From which on a line is written.
    form : str
        "text" for people; "json" is one JSON object a line.
    """

    level: Literal["DEBUG", "INFO", "WARNING", "ERROR"] = "INFO"
    form: Literal["text", "json"] = "text"


class HealthSettings(Table):
    """Health figures of a daemon, on the bus and over HTTP.

    Parameters
    ----------
    period_s : float
        From one to the next on the bus. [s]
    http : str, optional
        Address such as `127.0.0.1:9100` at which `/healthz` and `/metrics` answer; without it nothing listens.
    max_sample_age_s : float
        So long without a sample, and `/healthz` says that the daemon does not do its duty. [s]
    """

    period_s: Positive = 10.0
    http: Annotated[str, Field(pattern=r"^.+:\d{1,5}$")] | None = None
    max_sample_age_s: Positive = 60.0


class LeaseSettings(Table):
    """Daemons in pairs: one owner at a time, by a lease in PostgreSQL.

    Parameters
    ----------
    url : str, optional
        PostgreSQL database of leases, and of what their owners tell and keep, such as `postgresql://user@host/name`.
        Without it each daemon works alone.
    password_file : Path, optional
        File with the password of the database alone.
    group : str
        Name that the members of a pair share; pairs with other stations have another.
    member : str, optional
        Name of this member, for people; without it that of the machine.
    ttl_s : float
        Time of a lease, renewed five times in it: so long after its end at most another takes over. [s]
    """

    url: SecretStr | None = None
    password_file: Path | None = None
    group: Annotated[str, Field(pattern=NAME_PATTERN, max_length=64)] = "site"
    member: Annotated[str, Field(pattern=NAME_PATTERN, max_length=64)] | None = None
    ttl_s: Annotated[float, Field(ge=0.5, le=60.0)] = 1.5


class DetectorSettings(Table):
    """The detector.

    Parameters
    ----------
    state_dir : Path, optional
        Folder of what it has learnt; without it a restart learns anew.
    checkpoint_s : float
        From one saving of the state to the next. [s]
    crash_tries : int
        So often within `crash_window_s` a station may bring the process down until it is left out.
    crash_window_s : float
        Over which crashes are counted. [s]
    costs : Costs
        What acts and omissions cost at stations whose file says nothing of it.
    """

    state_dir: Path | None = None
    checkpoint_s: Positive = 60.0
    crash_tries: Annotated[int, Field(ge=1)] = 3
    crash_window_s: Positive = 86_400.0
    costs: Costs = Costs()


class RuleSettings(Table):
    """What is other than in the rule table for one kind of alarm; what is left out stays as it is there.

    Parameters
    ----------
    priority : str, optional
        How soon somebody has to act.
    on_delay_s, off_delay_s : float, optional
        So long must the condition hold, or be gone, before the alarm comes or returns, in the station's time. [s]
    is_enabled : bool, optional
        Whether there is such an alarm at all.
    is_latching : bool, optional
        Whether the alarm stays after its condition has gone, until it is reset.
    """

    priority: Priority | None = None
    on_delay_s: NonNegative | None = None
    off_delay_s: NonNegative | None = None
    is_enabled: bool | None = None
    is_latching: bool | None = None


class AlarmSettings(Table):
    """When the daemon of alarms calls, and where it keeps them.

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
    high_level_margin_m : float
        So far above the last start level is the high level, where none is given.
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
    """The watch of the gap between stations and their simulators.

    Parameters
    ----------
    state_dir : Path, optional
        Folder of its state; without it the state ends with the process.
    ask_s : float
        How often it asks the historian what was kept meanwhile. [s]
    threads : int
        Stations that are looked at side by side.
    fleet_prior : bool
        Whether a station that is diagnosed takes what the others have shown as its prior.
    """

    state_dir: Path | None = None
    ask_s: Positive = 60.0
    threads: Annotated[int, Field(ge=1)] = 1
    fleet_prior: bool = False


class HistorianSettings(Table):
    """The historian: where it keeps what, and for how long. Days count back from the newest sample of a station.

    Parameters
    ----------
    folder : Path
        Folder of the history.
    url : str, optional
        PostgreSQL database that is used in place of the folder, such as `postgresql://user@host/name`.
    password_file : Path, optional
        File with the password of the database alone.
    commit_s : float
        From one batch that is kept to the next. [s]
    maintain_s : float
        From one tidying to the next: days that are full become files, what is old goes. [s]
    spool_rows : int
        Samples and messages that wait in memory at the most while the disk or the database refuses.
    keep_live_days : int
        Days that stay where they are quick to reach.
    downsample_after_days : int, optional
        Age from which count, mean, least and largest of each minute take the place of samples; without it never.
    keep_days : int, optional
        Age from which all is deleted; without it never.
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
    """Who is let in.

    Parameters
    ----------
    tokens_file : Path, optional
        Tokens of the dashboard, made by `wetwell token`.
    audit_dir : Path, optional
        Folder in which each daemon writes down its starts with their settings, logins, writes over Modbus and orders;
        without it they are only logged.
    insecure : bool
        Whether to listen beyond this machine without asking who comes.
    """

    tokens_file: Path | None = None
    audit_dir: Path | None = None
    insecure: bool = False


class GatewaySettings(Table):
    """The gateway.

    Parameters
    ----------
    plcs : list of Path
        Files of the PLCs that it polls.
    longest_wait_s : float
        Longest wait before a connection that failed is made anew. [s]
    """

    plcs: tuple[Path, ...] = ()
    longest_wait_s: Positive = 30.0


class FleetSettings(Table):
    """Many stations on Dask.

    Parameters
    ----------
    scheduler : str, optional
        Address of a scheduler that runs already; without it workers start here.
    workers : int, optional
        How many to start here; default: one a core.
    shards : int
        Parts into which the stations are put; each is judged by one worker at a time.
    period_s : float
        From one look around to the next: what is new, who is gone. [s]
    """

    scheduler: Annotated[str, Field(pattern=r"^(tcp|tls)://.+:\d+$")] | None = None
    workers: Annotated[int, Field(ge=1)] | None = None
    shards: Annotated[int, Field(ge=1, le=10_000)] = 8
    period_s: Positive = 2.0


class DashboardSettings(Table):
    """The control-room page.

    Attributes
    ----------
    host : str
        Address on which it listens; beyond this machine only with `security.tokens_file`.
    port : int
        Where it listens; 0 takes a free one.
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
    lease: LeaseSettings = LeaseSettings()
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
