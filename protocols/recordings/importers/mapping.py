"""Mapping of an export to a recording: which tag is which signal, in which unit, and how the file is written."""

import codecs
from pathlib import Path
from typing import Annotated, Literal, Self
from zoneinfo import ZoneInfo

from pydantic import Field, ValidationError, field_validator, model_validator

from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.protocols.quantities import PUMP_QUANTITIES, STATION_QUANTITIES, pump_column, pump_of
from wetwell.protocols.recordings.covariates import COVARIATE_PREFIX, covariate_of
from wetwell.protocols.recordings.importers.signals.main_flow import RUN_QUANTITIES, is_main_flow
from wetwell.protocols.recordings.importers.times.time_format import TimeFormat
from wetwell.protocols.recordings.origin import StoredValue
from wetwell.protocols.station.station_file import NAME_PATTERN, load_toml
from wetwell.protocols.station.table import Finite, Positive, Table
from wetwell.protocols.units import factor, house_unit

Text = Annotated[str, Field(min_length=1)]
PumpNumber = Annotated[int, Field(ge=1)]


class Columns(Table):
    """Columns of the file: of a long one time, tag and value, and quality if it has one; of a wide one time alone.

    Attributes
    ----------
    time : str
        Header of the column.
    date : str, optional
        Header of the column with the date, where `time` has the time of day alone.
    tag, value : str, optional
        Of a long file: headers of the columns with the name of the tag and with its value.
    quality : str, optional
        Of a long file: header of the column with the quality of the value.
    good : tuple of str
        What stands in the quality of a value that can be trusted; any other value is none.
    """

    time: Text
    date: Text | None = None
    tag: Text | None = None
    value: Text | None = None
    quality: Text | None = None
    good: tuple[str, ...] = ()


class TagSignal(Table):
    r"""A tag of the export that is a column of the recording, or the flow of a main, which its pumps are handed.

    $$value = factor(unit) \cdot scale \cdot raw + offset$$

    and in unit "%" $low + (high - low)\, scale \cdot raw / 100 + offset$ with `span` = (low, high).

    Attributes
    ----------
    tag : str
        Name of the tag; in a wide file the header of its column.
    unit : str
        Of the raw number; empty is the unit of the recording.
    scale : float
        Factor on the raw number. [1]
    offset : float
        Added after the unit has been converted, in the unit of the recording.
    span : tuple, optional
        Values at 0 % and at 100 % in the unit of the recording; without it "%" is that of the nominal frequency.
    true, false : tuple of str
        Words and numbers of a pump that runs, and that stands; with `true` alone all others stand.
    no_value : tuple of str
        Words and numbers that mean "no value".
    quality : str, optional
        Of a wide file: header of the column with the quality of this tag.
    max_age_s : float, optional
        How long a stored value holds; default: that of the mapping. [s]
    pumps : tuple of int, optional
        Of the flow of a main: all of its pumps, from 1; default, where there is one main: those of the mapping.
    """

    tag: Text
    unit: str = ""
    scale: Finite = 1.0
    offset: Finite = 0.0
    span: tuple[Finite, Finite] | None = None
    true: tuple[str, ...] = ()
    false: tuple[str, ...] = ()
    no_value: tuple[str, ...] = ()
    quality: Text | None = None
    max_age_s: Positive | None = None
    pumps: Annotated[tuple[PumpNumber, ...], Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.scale == 0.0:
            raise ValueError("scale: got 0, must not be 0")
        if self.span is not None and self.unit != "%":
            raise ValueError(f"span: is for unit '%', got unit '{self.unit}'")
        if self.false and not self.true:
            raise ValueError("false: needs 'true' beside it")
        both = {word.casefold() for word in self.true} & {word.casefold() for word in self.false}
        if both:
            raise ValueError(f"true, false: '{min(both)}' stands in both")
        return self


class TagMapping(Table):
    """How the files of an export become one recording.

    Attributes
    ----------
    station : str
        Name of the station, kept with the recording.
    layout : "long" or "wide"
        One value a row, or one column a tag.
    delimiter, decimal, encoding, time_format : str, optional
        Found by looking where they are left out.
    sheet : str, optional
        Of an Excel file; default: its only one.
    time_zone : str, optional
        IANA name of the zone of stamps without offset.
    value : "instant", "mean" or "held"
        What a stored value stands for.
    step_s : float, optional
        Distance of the rows of the recording; default: the rows of the file, or for values stored on change the rate
        that was found. [s]
    max_age_s : float, optional
        How long a value stored on change holds. [s]
    columns : Columns
        Where time, tag and value stand.
    signal : dict of TagSignal
        By the column of the recording, such as `pump1_flow_m3h`; `main1_flow_m3h` is the flow of a main.
    """

    station: Annotated[str, Field(pattern=NAME_PATTERN, max_length=64)]
    layout: Literal["long", "wide"]
    delimiter: Annotated[str, Field(min_length=1, max_length=1)] | None = None
    decimal: Literal[".", ","] | None = None
    encoding: Text | None = None
    sheet: Text | None = None
    time_zone: Text | None = None
    time_format: Text | None = None
    value: StoredValue = "instant"
    step_s: Annotated[float, Field(ge=0.001, le=86_400.0)] | None = None
    max_age_s: Positive | None = None
    columns: Columns
    signal: Annotated[dict[str, TagSignal], Field(min_length=1)]

    @field_validator("time_zone")
    @classmethod
    def _check_zone(cls, name: str | None) -> str | None:
        try:
            _ = None if name is None else ZoneInfo(name)
        except (KeyError, ValueError, OSError) as error:
            raise ValueError(f"got '{name}', must be a time zone such as Europe/Helsinki") from error
        return name

    @field_validator("encoding")
    @classmethod
    def _check_encoding(cls, name: str | None) -> str | None:
        try:
            codecs.lookup(name or "utf-8")
        except LookupError as error:
            raise ValueError(
                f"got '{name}', must be an encoding such as utf-8, utf-16, cp1252 or iso-8859-1"
            ) from error
        return name

    @field_validator("time_format")
    @classmethod
    def _check_format(cls, text: str | None) -> str | None:
        _ = None if text is None else TimeFormat.of(text)
        return text

    @model_validator(mode="after")
    def _check_layout(self) -> Self:
        columns = self.columns
        if self.layout == "long":
            for name, header in {"tag": columns.tag, "value": columns.value}.items():
                if header is None:
                    raise ValueError(f"columns.{name}: missing, a long file needs it")
        elif columns.tag or columns.value or columns.quality:
            raise ValueError("columns: a wide file has time alone; the quality of a tag is named in its signal")
        for name, signal in self.signal.items():
            if signal.quality and self.layout == "long":
                raise ValueError(f"signal.{name}.quality: is for wide files; of a long one it is columns.quality")
        has_quality = columns.quality or any(signal.quality for signal in self.signal.values())
        if bool(has_quality) != bool(columns.good):
            raise ValueError("columns.good: is needed with a quality, and only there; such as ['GOOD', '192']")
        return self

    @model_validator(mode="after")
    def _check_signals(self) -> Self:
        for name, signal in self.signal.items():
            _check_signal(name, signal)
            if self.value == "held" and self.max_age_s is None and signal.max_age_s is None:
                raise ValueError("max_age_s: missing; values stored on change need a time after which they are none")
        if self.value != "held" and self.max_age_s is not None:
            raise ValueError(f"max_age_s: is for value 'held', got value '{self.value}'")
        if not any(pump_of(name) for name in self.signal):
            raise ValueError("signal: no signal of a pump such as pump1_flow_m3h")
        self._check_mains()
        return self

    def _check_mains(self) -> None:
        known = self._pumps
        taken: dict[int, str] = {}
        mains = [name for name in self.signal if is_main_flow(name)]
        for name in mains:
            if len(mains) > 1 and self.signal[name].pumps is None:
                raise ValueError(f"signal.{name}.pumps: missing, each of several mains needs its own")
            for pump in self.mains[name]:
                if pump not in known:
                    there = ", ".join(map(str, known))
                    raise ValueError(f"signal.{name}.pumps: got {pump}, the mapping has signals of pump {there}")
                if pump in taken:
                    again = "comes twice" if taken[pump] == name else f"is in {taken[pump]} already"
                    raise ValueError(f"signal.{name}.pumps: got {pump}, which {again}")
                taken[pump] = name
                flow, *runs = (pump_column(pump, quantity) for quantity in ("flow_m3h", *RUN_QUANTITIES))
                if flow in self.signal:
                    raise ValueError(f"signal.{name}.pumps: got {pump}, which has a flow of its own, {flow}")
                if not any(run in self.signal for run in runs):
                    needed = " or ".join(runs)
                    raise ValueError(f"signal.{name}.pumps: got {pump}, which needs {needed}, to tell when it runs")

    @property
    def _pumps(self) -> tuple[int, ...]:
        """Numbers of the pumps that have a signal of their own, in order."""
        return tuple(sorted({pump_of(name) for name in self.signal} - {0}))

    @property
    def mains(self) -> dict[str, tuple[int, ...]]:
        """Pumps of each main that has a flow meter, by its signal."""
        return {name: signal.pumps or self._pumps for name, signal in self.signal.items() if is_main_flow(name)}

    def tag_of(self, column: str) -> str:
        """Tag that a column of the recording comes from: that of the main, where a pump has its flow."""
        of_main = {pump_column(pump, "flow_m3h"): main for main, pumps in self.mains.items() for pump in pumps}
        return self.signal[of_main.get(column, column)].tag


def _check_signal(name: str, signal: TagSignal) -> None:
    is_known = name in STATION_QUANTITIES or pump_of(name) or covariate_of(name) is not None
    if not is_known and not is_main_flow(name):
        raise ValueError(
            f"signal.{name}: is no column of a recording, must be {', '.join(STATION_QUANTITIES)}, pump1_ and so on "
            f"with {', '.join(PUMP_QUANTITIES)}, {COVARIATE_PREFIX} with a name such as rain_mm_h, or main1_flow_m3h"
        )
    if signal.pumps is not None and not is_main_flow(name):
        raise ValueError(f"signal.{name}.pumps: is for main1_flow_m3h and so on")
    is_flag = name.endswith("_running")
    if signal.true and not is_flag:
        raise ValueError(f"signal.{name}.true: is for pump1_running and so on")
    if signal.unit == "%" and (is_flag or (signal.span is None and not name.endswith("_frequency_hz"))):
        raise ValueError(f"signal.{name}.span: missing, [value at 0 %, value at 100 %] is needed for unit '%'")
    if signal.unit not in {"", "%"}:
        try:
            factor(signal.unit, house_unit(name))
        except ValueError as error:
            raise ValueError(f"signal.{name}.{error}") from error


def load_mapping(path: Path) -> TagMapping:
    """Mapping in a TOML file.

    Raises
    ------
    ConfigError
        If a rule is broken; one line with file, key, value and rule.
    """
    try:
        return TagMapping.model_validate(load_toml(path))
    except ValidationError as error:
        raise ConfigError(f"{path}: {first_fault(error)}") from error
