"""Messages on the bus: sample, verdict, order, status. JSON with `schema`, times in ISO 8601 UTC."""

from datetime import datetime
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainSerializer, ValidationError

from wetwell.protocols.errors import WetwellError, first_fault
from wetwell.protocols.timestamps import MAX_STAMP_NS, from_iso, to_iso

JSON_ENCODING = "application/json"

State = Literal[
    "learning",
    "normal",
    "pump_fault",
    "system_fault",
    "pump_and_system_fault",
    "sensor_fault",
    "unknown",
]
"""What a verdict says of one pump."""

ServiceState = Literal["starting", "running", "waiting", "stopping"]
"""How a service is: waiting means for somebody else, such as a PLC that is away."""

Quality = Literal["good", "uncertain", "bad"]
"""What the source of a sample thinks of it, in the words of OPC."""


class MessageError(WetwellError):
    """A payload is not the message that its key promises."""


def _stamp(value: object) -> object:
    if isinstance(value, str):
        return from_iso(value)
    if isinstance(value, datetime):
        return from_iso(value.isoformat())
    return value


Stamp = Annotated[
    int,
    BeforeValidator(_stamp),
    Field(ge=-MAX_STAMP_NS, le=MAX_STAMP_NS),
    PlainSerializer(to_iso, return_type=str),
]
"""Nanoseconds since 1970 in code, ISO 8601 text in JSON."""

Number = float | None
"""A measured value; None, NaN and infinities stand for "no value", which is `null` in JSON."""


class Message(BaseModel):
    """Base of the messages: frozen; further keys from newer senders are ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore", populate_by_name=True, serialize_by_alias=True)

    def encode(self) -> bytes:
        """UTF-8 JSON of the message."""
        return self.__pydantic_serializer__.to_json(self)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Message in a JSON payload.

        Raises
        ------
        MessageError
            If the payload is not such a message; names key, value and rule.
        """
        try:
            return cls.model_validate_json(payload)
        except ValidationError as error:
            raise MessageError(f"{cls.__name__.lower()}: {first_fault(error)}") from error


class PumpReading(Message):
    """What is measured at one pump."""

    frequency_hz: Number = None
    flow_m3h: Number = None
    head_m: Number = None
    power_kw: Number = None
    running: bool | None = None


class Sample(Message):
    """What is measured at one station in one second. `seq` counts up by one within a source's life."""

    schema_name: Literal["wetwell.sample/1"] = Field("wetwell.sample/1", alias="schema")
    station: str
    seq: int = Field(ge=0, lt=2**63)
    time: Stamp
    level_m: Number = None
    inflow_m3h: Number = None
    pumps: tuple[PumpReading, ...]
    quality: Quality = "good"


class Verdict(Message):
    """What the detector says of one pump after a run, or when its state changes.

    `probability` sums to one over the states that were weighed; `evidence` holds the figures that it rests on;
    `window` is the time that was judged.
    """

    schema_name: Literal["wetwell.verdict/1"] = Field("wetwell.verdict/1", alias="schema")
    time: Stamp
    station: str
    pump: int = Field(ge=1)
    state: State
    probability: dict[State, float]
    evidence: dict[str, Any]
    onset: Stamp | None = None
    window: tuple[Stamp, Stamp]


class Order(Message):
    """An act of an operator on the detector of a station; the verdict that follows carries its `id` as evidence."""

    schema_name: Literal["wetwell.order/1"] = Field("wetwell.order/1", alias="schema")
    id: str = Field(min_length=1, max_length=64)
    time: Stamp
    station: str
    pump: int = Field(ge=1)
    act: Literal["rebaseline", "revert"]
    by: str = Field(min_length=1, max_length=64)


class Status(Message):
    """Health figures of one service, once in a while; `reason` says what is wrong, for people."""

    schema_name: Literal["wetwell.status/1"] = Field("wetwell.status/1", alias="schema")
    time: Stamp
    station: str
    service: str
    state: ServiceState
    figures: dict[str, float]
    reason: str = ""
