"""Maintenance: what a crew did to an asset, what it found, and what the detector saw of it."""

from typing import Annotated, Literal

from pydantic import Field

from wetwell.protocols.messages.message import Message, Stamp
from wetwell.protocols.messages.verdict import Severity

AssetName = Annotated[str, Field(max_length=64, pattern=r"^(pump:[1-9][0-9]*|main(:.+)?|sensor:[a-z0-9_]+)$")]

Result = Literal["pending", "back", "better", "no change", "learning anew", "refused"]
"""What the detector saw of an act: too few runs yet; back to what it was in health; better; nothing; nothing that can
be compared, since a meter or a part is another one now and the healthy pump is learnt anew; that there is no such
asset."""

NOTHING = "nothing"
"""What was found where all was well."""


class MaintenanceAct(Message):
    """An act of a crew.

    Parameters
    ----------
    id : str
        Makes it safe to enter the act twice.
    time : stamp, optional
        When it was done; none: just now.
    asset : str
        At what: `pump:2`, `main`, `main:line 1` or `sensor:pump2_flow_m3h`.
    act : str
        What was done.
    found : str
        What the crew saw, "nothing" if all was well, empty if nobody looked.
    by : str
        Who did it.
    """

    schema_name: Literal["wetwell.maintenance-act/1"] = Field("wetwell.maintenance-act/1", alias="schema")
    id: str = Field(min_length=1, max_length=64)
    time: Stamp | None = None
    station: str
    asset: AssetName
    act: str = Field(min_length=1, max_length=100)
    found: str = Field("", max_length=500)
    by: str = Field(min_length=1, max_length=64)


class MaintenanceRecord(Message):
    """An act in the log, with the severity before it and after the runs that followed.

    Parameters
    ----------
    id : str
        Of the act.
    asset : str
        At what: `pump:2`, `main`, `main:line 1` or `sensor:pump2_flow_m3h`.
    act : str
        What was done.
    found : str
        What the crew saw.
    by : str
        Who did it.
    result : str
        What the detector saw of it.
    before, after : Severity, optional
        How bad the asset was before the act, and is since.
    refused : str
        Why it is not in the log.
    """

    schema_name: Literal["wetwell.maintenance/1"] = Field("wetwell.maintenance/1", alias="schema")
    id: str = Field(min_length=1, max_length=64)
    time: Stamp
    station: str
    asset: AssetName
    act: str
    found: str = ""
    by: str
    result: Result = "pending"
    before: Severity | None = None
    after: Severity | None = None
    refused: str = ""
