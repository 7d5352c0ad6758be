"""How far a station is from its simulator, since when, and what that is called."""

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from wetwell.protocols.messages.message import Message, Stamp


class _Part(BaseModel):
    """Part of a message: frozen; further keys from newer senders are ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class GapName(_Part):
    """What the gap, or a part of it, is called.

    `effect` is as in the report of a diagnosis, None where nothing of the library explains it. `since` is when it
    began to grow, None where it was there at the first look; `ended` when it was over. `fault` is the asset as whose
    fault the detector tells it: then it is no gap of the model. `text` says all this in one line.
    """

    effect: dict[str, Any] | None = None
    component: str
    probability: float
    since: Stamp | None = None
    ended: Stamp | None = None
    fault: str | None = None
    text: str = Field("", max_length=1000)


class GapLook(_Part):
    """A look at a span until `time`: the gap by signal, and the gap that matters; units as in `GapWatch`."""

    time: Stamp
    gap: dict[str, float]
    matters: float
    interval: tuple[float, float]


class GapWatch(Message):
    """The watched gap of a station after its last look, at `time`.

    `gap` has the gap of the station file by signal: 1 is noise alone. `matters` is the largest shift of a signal of
    a pump in a regime, `group`, in units of what matters to anybody (`[materiality]` of the station file); it was
    `first_matters` at the first look, and `is_doubled` says whether it has doubled since and is no fault that the
    detector tells. `looks` are the last ones, oldest first. `refused` says why nothing could be looked at since.
    """

    schema_name: Literal["wetwell.gap-watch/1"] = Field("wetwell.gap-watch/1", alias="schema")
    time: Stamp
    station: str
    gap: dict[str, float]
    matters: float
    interval: tuple[float, float]
    group: str
    first_matters: float
    is_doubled: bool = False
    called: tuple[GapName, ...] = ()
    past: tuple[GapName, ...] = ()
    looks: tuple[GapLook, ...] = ()
    refused: str = ""
