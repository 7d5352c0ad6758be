"""Status: health figures of a service."""

from typing import Literal

from pydantic import Field

from wetwell.protocols.messages.message import Message, Stamp

ServiceState = Literal["starting", "running", "waiting", "stopping"]
"""How a service is: waiting means for somebody else, such as a PLC that is away."""


class Status(Message):
    """Health figures of one service, once in a while.

    Parameters
    ----------
    service : str
        Name of the service.
    state : str
        How it is; `waiting` means for somebody else, such as a PLC that is away.
    figures : dict
        By name, each ending with its unit.
    reason : str
        What is wrong, for people.
    """

    schema_name: Literal["wetwell.status/1"] = Field("wetwell.status/1", alias="schema")
    time: Stamp
    station: str
    service: str
    state: ServiceState
    figures: dict[str, float]
    reason: str = ""
