"""What every message on the bus is: JSON with `schema`, times in ISO 8601 UTC."""

from datetime import datetime
from typing import Annotated, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainSerializer, ValidationError, WithJsonSchema

from wetwell.protocols.errors import WetwellError, first_fault
from wetwell.protocols.timestamps import MAX_STAMP_NS, from_iso, to_iso

JSON_ENCODING = "application/json"


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
    WithJsonSchema({"type": "string", "format": "date-time"}),
]
"""Nanoseconds since 1970 in code, ISO 8601 text in JSON."""

Number = float | None
"""A measured value; None, NaN and infinities stand for "no value", which is `null` in JSON."""


class Message(BaseModel):
    """Base of the messages: frozen; further keys from newer senders are ignored.

    Parameters
    ----------
    schema : str
        Form of the message and its version.
    station : str
        Name of the station, as in its file.
    time : stamp
        ISO 8601, UTC, in the time of the station.
    """

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
