"""Sample: what is measured at one station in one second."""

from typing import Literal

from pydantic import Field

from wetwell.protocols.messages.message import Message, Number, Stamp

Quality = Literal["good", "uncertain", "bad"]
"""What the source of a sample thinks of it, in the words of OPC."""


class PumpReading(Message):
    """What is measured at one pump; null is "no value".

    Parameters
    ----------
    frequency_hz : float, optional
        Frequency of the drive.
    flow_m3h : float, optional
        What the pump delivers, by its own meter.
    head_m : float, optional
        Between suction and pressure side.
    power_kw : float, optional
        Electrical power that the drive takes.
    running : bool, optional
        Whether it runs.
    """

    frequency_hz: Number = None
    flow_m3h: Number = None
    head_m: Number = None
    power_kw: Number = None
    running: bool | None = None


class Sample(Message):
    """What is measured at one station in one second; null is "no value".

    Parameters
    ----------
    seq : int
        Counts up by one within a source's life.
    level_m : float, optional
        In the wet well.
    inflow_m3h : float, optional
        To the wet well.
    pumps : list of PumpReading
        In the order of the station file.
    quality : str
        What the source thinks of the sample, in the words of OPC.
    """

    schema_name: Literal["wetwell.sample/1"] = Field("wetwell.sample/1", alias="schema")
    station: str
    seq: int = Field(ge=0, lt=2**63)
    time: Stamp
    level_m: Number = None
    inflow_m3h: Number = None
    pumps: tuple[PumpReading, ...]
    quality: Quality = "good"


class LevelSample(Message):
    """What a `Sample` says of the wet well: read alone it costs a third.

    Parameters
    ----------
    seq : int
        Counts up by one within a source's life.
    level_m : float, optional
        In the wet well.
    quality : str
        What the source thinks of the sample, in the words of OPC.
    """

    schema_name: Literal["wetwell.sample/1"] = Field("wetwell.sample/1", alias="schema")
    station: str
    seq: int = Field(ge=0, lt=2**63)
    time: Stamp
    level_m: Number = None
    quality: Quality = "good"
