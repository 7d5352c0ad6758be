"""PLCs that a gateway polls: address, pace and register map of each, in TOML, checked to the last key."""

import ssl
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Literal, Self

from pydantic import Field, ValidationError, model_validator

from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.protocols.messages.sample import Quality
from wetwell.protocols.modbus.device_csv import read_map_csv
from wetwell.protocols.modbus.device_signal import ByteOrder, Signal, check_signal
from wetwell.protocols.modbus.registers import MAX_PUMPS
from wetwell.protocols.quantities import pumps_of
from wetwell.protocols.station.station_file import NAME_PATTERN, load_station, load_toml
from wetwell.protocols.station.table import NonNegative, Positive, Table


class Tls(Table):
    """Modbus over TLS: who must have signed the PLC's certificate, and what the gateway shows of itself. PEM files.

    Attributes
    ----------
    ca : Path
        Authority that must have signed the certificate of the PLC.
    certificate, key : Path, optional
        What the gateway shows of itself, where the PLC asks for it.
    server_name : str, optional
        Name for which the certificate of the PLC is made, where it is not `host`.
    """

    ca: Path
    certificate: Path | None = None
    key: Path | None = None
    server_name: str | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.certificate is None) != (self.key is None):
            raise ValueError("certificate and key: give both or none")
        return self


class Device(Table):
    """A `[[plc]]` table.

    Attributes
    ----------
    station, pumps : str, int, optional
        Name and number of pumps, where no station file gives them; without either the map tells the number.
    station_file, map : Path, optional
        Files beside this one. A map is a CSV as `wetwell modbus-map` writes it; a `signal` here overrules its rows.
    host : str
        Address or name of the PLC.
    port : int
        Of the PLC; 502 is the standard one, 802 that with TLS.
    unit_id : int
        Of the PLC; a bridge to serial lines tells its devices apart by it.
    period_s : float
        Time from poll to poll. [s]
    word_order : str
        Order in which the four bytes of a 32-bit value arrive, A being the highest.
    connect_timeout_s, answer_timeout_s : float
        Time after which a connection, or an answer, is no longer waited for. [s]
    max_gap, max_words : int
        Registers that nobody asks for and that are read nevertheless, to save a request; most words of a request.
    heartbeat_s, heartbeat_quality : float, str
        Time that the heartbeat may stand, and the quality of samples from then on. [s]
    clock : "gateway" or "plc"
        Whose time a sample bears; "plc" needs the signal `time_s`.
    fixed_frequency_hz : float, optional
        Frequency of running pumps that have no drive: for those without a signal of it. [Hz]
    tls : Tls, optional
        For a PLC that is reached over TLS.
    signal : dict of Signal
        By the column of the recording, such as `pump1_flow_m3h`; also `heartbeat` and `time_s`.
    """

    station: Annotated[str, Field(pattern=NAME_PATTERN, max_length=64)] | None = None
    station_file: Path | None = None
    pumps: Annotated[int, Field(ge=1, le=MAX_PUMPS)] | None = None
    host: Annotated[str, Field(min_length=1)]
    port: Annotated[int, Field(ge=1, le=65535)] = 502
    unit_id: Annotated[int, Field(ge=0, le=255)] = 1
    period_s: Positive = 1.0
    connect_timeout_s: Positive = 3.0
    answer_timeout_s: Positive = 1.0
    word_order: ByteOrder = "ABCD"
    max_gap: Annotated[int, Field(ge=0, le=124)] = 16
    max_words: Annotated[int, Field(ge=2, le=125)] = 125
    heartbeat_s: Positive = 10.0
    heartbeat_quality: Quality = "bad"
    clock: Literal["gateway", "plc"] = "gateway"
    fixed_frequency_hz: NonNegative | None = None
    tls: Tls | None = None
    map: Path | None = None
    signal: dict[str, Signal] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.station is None and self.station_file is None:
            raise ValueError("station: missing, give station or station_file")
        if self.pumps is not None and self.station_file is not None:
            raise ValueError("pumps: the station_file says it")
        for name, signal in self.signal.items():
            check_signal(name, signal, self.pumps)
        return self


class DeviceFile(Table):
    """A file of several PLCs.

    Attributes
    ----------
    plc : list of Device
        One table a PLC; a file of one PLC may have its keys alone.
    """

    plc: Annotated[tuple[Device, ...], Field(min_length=1)]


@dataclass(frozen=True, kw_only=True)
class Plc:
    """A PLC with all that its files say.

    Attributes
    ----------
    station : str
        Name under which its samples are published.
    pumps : int
        Number of pumps.
    device : Device
        How it is reached.
    signals : mapping of name to Signal
        What is read.
    tls : ssl.SSLContext, optional
        For a PLC that is reached over TLS.
    """

    station: str
    pumps: int
    device: Device
    signals: Mapping[str, Signal]
    tls: ssl.SSLContext | None = None

    @property
    def endpoint(self) -> str:
        """Where it is, for messages."""
        return f"Modbus TCP {self.device.host}:{self.device.port} unit {self.device.unit_id}"


def load_plcs(path: Path) -> tuple[Plc, ...]:
    """PLCs in a TOML file: `[[plc]]` tables, or the keys of one.

    Raises
    ------
    ConfigError
        If a rule is broken; one line with file, key, value and rule.
    """
    tables = load_toml(path)
    try:
        devices = DeviceFile.model_validate(tables).plc if "plc" in tables else (Device.model_validate(tables),)
    except ValidationError as error:
        raise ConfigError(f"{path}: {first_fault(error)}") from error
    plcs = tuple(_completed(device, path) for device in devices)
    check_stations(plcs, str(path))
    return plcs


def check_stations(plcs: tuple[Plc, ...], place: str) -> None:
    """Refuse two PLCs that would publish under one name.

    Raises
    ------
    ConfigError
        Names the place and the station.
    """
    names: set[str] = set()
    for plc in plcs:
        if plc.station in names:
            raise ConfigError(f"{place}: station '{plc.station}': has two PLCs, must have one")
        names.add(plc.station)


def _completed(device: Device, path: Path) -> Plc:
    name, pumps = device.station, device.pumps
    if device.station_file is not None:
        station = load_station(path.parent / device.station_file)
        if name not in {None, station.name}:
            raise ConfigError(f"{path}: station: got '{name}', {device.station_file} says '{station.name}'")
        name, pumps = station.name, len(station.pump)
    try:
        signals = _signals(device, path.parent, pumps)
        tls = _tls_context(device.tls, path.parent) if device.tls is not None else None
    except ValueError as error:
        raise ConfigError(f"{path}: station '{name}': {error}") from error
    if pumps is None:
        pumps = max(1, pumps_of(signals))
    return Plc(station=str(name), pumps=pumps, device=device, signals=MappingProxyType(signals), tls=tls)


def _signals(device: Device, folder: Path, pumps: int | None) -> dict[str, Signal]:
    rows = read_map_csv(folder / device.map, pumps) if device.map is not None else {}
    for name, signal in device.signal.items():
        check_signal(name, signal, pumps)
    signals = rows | device.signal
    if not signals:
        raise ValueError("signal: missing, give a map or [signal] tables")
    if device.clock == "plc" and "time_s" not in signals:
        raise ValueError("clock: got 'plc', needs the signal time_s")
    return signals


def _tls_context(tls: Tls, folder: Path) -> ssl.SSLContext:
    for key, file in tls.model_dump(exclude={"server_name"}, exclude_none=True).items():
        if not (folder / file).is_file():
            raise ValueError(f"tls.{key}: got '{file}', is no file")
    try:
        context = ssl.create_default_context(cafile=folder / tls.ca)
        if tls.certificate is not None and tls.key is not None:
            context.load_cert_chain(folder / tls.certificate, folder / tls.key, password="")  # never ask for one
    except ssl.SSLError as error:
        raise ValueError(f"tls: the files hold no certificate or key that fits: {error.reason or error}") from error
    return context
