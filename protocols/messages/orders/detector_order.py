"""Order: an act of an operator on a detector."""

from typing import Literal

from pydantic import Field

from wetwell.protocols.messages.message import Message, Stamp


class Order(Message):
    """An act of an operator on the detector of a station; the verdict that follows carries its `id` as evidence."""

    schema_name: Literal["wetwell.order/1"] = Field("wetwell.order/1", alias="schema")
    id: str = Field(min_length=1, max_length=64)
    time: Stamp
    station: str
    pump: int = Field(ge=1)
    act: Literal["rebaseline", "revert"]
    by: str = Field(min_length=1, max_length=64)
