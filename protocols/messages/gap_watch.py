"""How far a station is from its simulator, since when, and what that is called."""

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from wetwell.protocols.messages.message import Message, Stamp


class _Part(BaseModel):
    """Part of a message: frozen; further keys from newer senders are ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class GapName(_Part):
    """What the gap, or a part of it, is called.

    Parameters
    ----------
    effect : dict, optional
        As in the report of a diagnosis: name, component, parameters; none where nothing of the library explains it.
    component : str
        The one held responsible.
    probability : float
        Of the verdict that named it. [1]
    since : str, optional
        When it began to grow; none where it was there at the first look.
    ended : str, optional
        When it was over.
    fault : str, optional
        The asset as whose fault the detector tells it, such as `main`: then it is no gap of the model.
    text : str
        All this in one line.
    """

    effect: dict[str, Any] | None = None
    component: str
    probability: float
    since: Stamp | None = None
    ended: Stamp | None = None
    fault: str | None = None
    text: str = Field("", max_length=1000)


class GapLook(_Part):
    """A look at a span of a station.

    Parameters
    ----------
    time : str
        Its end.
    gap : dict
        Gap of the station file by signal, in units of noise: 1 is noise alone. [1]
    matters : float
        The largest shift of a signal of a pump in a regime, over what matters to anybody. [1]
    interval : list of float
        Its 95 % interval. [1]
    """

    time: Stamp
    gap: dict[str, float]
    matters: float
    interval: tuple[float, float]


class GapWatch(Message):
    """The watched gap of a station after its last look.

    Parameters
    ----------
    time : str
        End of the last look, in the time of the station.
    gap : dict
        Gap of the station file by signal, in units of noise: 1 is noise alone. [1]
    matters : float
        The largest shift of a signal of a pump in a regime, over what matters to anybody (`[materiality]` of the
        station file). [1]
    interval : list of float
        Its 95 % interval. [1]
    group : str
        Signal, pump (from 1; 0 is the station) and regime of that shift, such as `flow/1/steady`.
    first_matters : float
        The same at the first look. [1]
    is_doubled : bool
        Whether it has doubled since, is more than what matters, and is no fault that the detector tells.
    called : list of GapName
        What the gap is called now.
    past : list of GapName
        What it was called once and is over, the last ones.
    looks : list of GapLook
        The last ones, oldest first.
    refused : str
        Why nothing could be looked at since; empty where it could.
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
