"""Sample: what is measured at one station in one second."""

from typing import Literal

from pydantic import Field

from wetwell.protocols.messages.message import Message, Number, Stamp

Quality = Literal["good", "uncertain", "bad"]
"""What the source of a sample thinks of it, in the words of OPC."""


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


class LevelSample(Message):
    """What a `Sample` says of the wet well: read alone it costs a third."""

    schema_name: Literal["wetwell.sample/1"] = Field("wetwell.sample/1", alias="schema")
    station: str
    seq: int = Field(ge=0, lt=2**63)
    time: Stamp
    level_m: Number = None
    quality: Quality = "good"
