"""Verdict: what the detector says of one pump, and of what is at fault."""

import re
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

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

Stage = Literal["watch", "plan", "act"]
"""What to do about a fault: it is there; plan a visit; somebody has to act."""


class _Part(BaseModel):
    """Part of a message: frozen; further keys from newer senders are ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class Severity(_Part):
    """How bad a fault is, beside the station's action limit.

    Parameters
    ----------
    quantity : str
        What is told; its name ends with its unit. Of `[limits]` of the station file, such as `friction_rise_percent`.
    value : float
        In the unit of the quantity.
    interval : (float, float)
        In which the true value lies with 95 %, in the same unit.
    limit : float
        Value at which somebody has to act, in the same unit.
    """

    quantity: str
    value: float
    interval: tuple[float, float]
    limit: float = Field(gt=0.0)


class Trend(_Part):
    """How a severity grows, and when it reaches the limit.

    Parameters
    ----------
    per_day : float
        Growth a day, in the unit of the severity's quantity.
    interval : (float, float)
        In which the true growth lies with 95 %.
    reaches_limit : stamp, optional
        When the limit is reached; none where the severity does not grow, or has passed it.
    interval_at : (stamp or none, stamp or none)
        Earliest and latest time of that with 95 %; none for one that may never come.
    """

    per_day: float
    interval: tuple[float, float]
    reaches_limit: Stamp | None = None
    interval_at: tuple[Stamp | None, Stamp | None] = (None, None)


class AssetFault(_Part):
    """What is wrong with one asset.

    Parameters
    ----------
    asset : str
        `pump:2`, `main`, `main:line 1` or `sensor:pump2_flow_m3h`.
    stage : str
        What to do: keep an eye on it (`watch`), plan a visit (`plan`), go (`act`).
    since : stamp
        When it began, as far as the detector knows.
    severity : Severity, optional
        How bad it is; none where no size can be told.
    trend : Trend, optional
        How it grows; none where too little is known.
    advice : str
        What a crew should do, in a sentence.
    """

    asset: str = Field(min_length=1, max_length=64)
    stage: Stage
    since: Stamp
    severity: Severity | None = None
    trend: Trend | None = None
    advice: str = Field("", max_length=500)


class Verdict(Message):
    """What the detector says of one pump after a run, or when its state changes.

    Parameters
    ----------
    time : stamp
        When it was said, in the time of the station.
    pump : int
        Which one, counted from 1.
    state : str
        What is different: nothing, the pump, its main ("system"), both, a meter; `learning` until a baseline is
        known, `unknown` where no cause fits.
    probability : dict
        Of each state that was weighed; they sum to 1.
    evidence : dict
        The figures that it rests on, by name: docs/detection.md.
    onset : stamp, optional
        When the fault began; none without a fault, or where that is not known.
    window : (stamp, stamp)
        Beginning and end of the time that was judged.
    asset : str, optional
        Asset of the worst fault: `pump:2`, `main`, `main:line 1` or `sensor:pump2_flow_m3h`.
    stage : str, optional
        What to do about the worst fault: keep an eye on it (`watch`), plan a visit (`plan`), go (`act`).
    severity : Severity, optional
        Of the worst fault.
    trend : Trend, optional
        Of the worst fault.
    faults : list of AssetFault, optional
        What stands of the pump, its main and its meters, the worst first; none where the sender does not tell it.
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
    asset: str | None = None
    stage: Stage | None = None
    severity: Severity | None = None
    trend: Trend | None = None
    faults: tuple[AssetFault, ...] | None = None

    @property
    def main(self) -> str:
        """The asset that is the main of the pump."""
        name = self.evidence.get("main")
        return f"main:{name}" if isinstance(name, str) and name else "main"

    def speaks_of(self, asset: str) -> bool:
        """Whether it says whether a fault of this asset stands: of its pump, its main, and no meter of another pump.

        Examples
        --------
        >>> verdict = Verdict(time=0, station="s", pump=2, state="normal", probability={}, evidence={}, window=(0, 0))
        >>> [verdict.speaks_of(asset) for asset in ("pump:2", "pump:1", "main", "main:b", "sensor:pump21_flow_m3h")]
        [True, False, True, False, False]
        """
        kind, _, name = asset.partition(":")
        if kind == "pump":
            return name == str(self.pump)
        if kind == "main":
            return asset == self.main
        of_pump = re.match(r"pump(\d+)", name)
        return of_pump is None or int(of_pump[1]) == self.pump

    def standing(self) -> tuple[AssetFault, ...] | None:
        """Faults that stand of the pump, its main and its meters; None where the verdict says nothing of them.

        Those of a sender that tells a state alone are that state, to be acted on.
        """
        if self.faults is not None:
            return self.faults
        if self.state == "unknown":
            return None
        assets = {
            "pump_fault": (f"pump:{self.pump}",),
            "system_fault": (self.main,),
            "pump_and_system_fault": (f"pump:{self.pump}", self.main),
            "sensor_fault": (f"sensor:pump{self.pump}",),
        }.get(self.state, ())
        since = self.time if self.onset is None else self.onset
        stage = self.stage or "act"
        return tuple(AssetFault(asset=asset[:64], stage=stage, since=since) for asset in assets)
