"""Verdict: what the detector says of one pump."""

from typing import Any, Literal

from pydantic import Field

from wetwell.protocols.messages.message import Message, Stamp

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
