"""Orders: of an operator to a detector, and of the controller of a fleet to a shard."""

from typing import Literal

from pydantic import Field

from wetwell.protocols.messages.message import Message, Stamp
from wetwell.protocols.station.station_file import Station


class Order(Message):
    """An act of an operator on the detector of a station; the verdict that follows carries its `id` as evidence.

    Parameters
    ----------
    id : str
        Of the order.
    pump : int
        Which one, counted from 1.
    act : str
        Learn the healthy pump anew, or go back to what was learnt before.
    by : str
        Who orders it.
    """

    schema_name: Literal["wetwell.order/1"] = Field("wetwell.order/1", alias="schema")
    id: str = Field(min_length=1, max_length=64)
    time: Stamp
    station: str
    pump: int = Field(ge=1)
    act: Literal["rebaseline", "revert"]
    by: str = Field(min_length=1, max_length=64)


class Plan(Message):
    """Stations of a shard; the shard works while `epoch` is its own, and ends when a later one goes elsewhere.

    Parameters
    ----------
    shard : int
        Which one, counted from 0.
    epoch : int
        Counts how often the shard has been given to a worker.
    stations : list of Station
        Their station files.
    """

    schema_name: Literal["wetwell.plan/1"] = Field("wetwell.plan/1", alias="schema")
    time: Stamp
    shard: int = Field(ge=0)
    epoch: int = Field(ge=0)
    stations: tuple[Station, ...]
