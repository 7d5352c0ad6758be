"""The clock of a simulated plant: how fast it runs, whether it stands, and orders to it."""

from typing import Annotated, Literal

from pydantic import Field

from wetwell.protocols.messages.message import Message

Speed = Annotated[float, Field(gt=0.0, le=1e6)]
"""Seconds of the plant in a second on the wall. [1]"""


class PlantClockOrder(Message):
    """What the clock of a plant is to do; what is left out stays as it is. Without anything it asks how it stands.

    Parameters
    ----------
    speed : float, optional
        Seconds of the plant in a second on the wall. [1]
    is_held : bool, optional
        Whether it stands still.
    look_s : float
        For so long on the wall it runs no faster than `LOOK_SPEED`, then as before; nothing while it stands. [s]
    """

    schema_name: Literal["wetwell.plant-clock-order/1"] = Field("wetwell.plant-clock-order/1", alias="schema")
    speed: Speed | None = None
    is_held: bool | None = None
    look_s: float = Field(0.0, ge=0.0, le=3600.0)


class PlantClock(Message):
    """How the clock of a plant stands: it answers an order.

    Parameters
    ----------
    seconds : int
        Of the plant that have passed. [s]
    speed : float
        Seconds of the plant in a second on the wall. [1]
    full_speed : float
        The one that it was started with, and the fastest. [1]
    is_held : bool
        Whether it stands still.
    error : str
        Why an order was not carried out.
    """

    schema_name: Literal["wetwell.plant-clock/1"] = Field("wetwell.plant-clock/1", alias="schema")
    station: str
    seconds: int
    speed: Speed
    full_speed: Speed
    is_held: bool
    error: str = ""
