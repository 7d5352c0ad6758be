"""What the controller of a fleet tells a shard."""

from typing import Literal

from pydantic import Field

from wetwell.protocols.messages.message import Message, Stamp
from wetwell.protocols.station.station_file import Station


class Plan(Message):
    """Stations of a shard; the shard works while `epoch` is its own, and ends when a later one goes elsewhere."""

    schema_name: Literal["wetwell.plan/1"] = Field("wetwell.plan/1", alias="schema")
    time: Stamp
    shard: int = Field(ge=0)
    epoch: int = Field(ge=0)
    stations: tuple[Station, ...]
