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
    """How bad a fault is: a quantity with its unit, its 95 % interval, and the station's action limit."""

    quantity: str
    value: float
    interval: tuple[float, float]
    limit: float = Field(gt=0.0)


class Trend(_Part):
    """How a severity grows by the day, with a 95 % interval, and when it reaches the limit.

    `reaches_limit` is None where it does not grow, or has passed the limit. `interval_at` are the earliest and the
    latest time; None for one that may never come.
    """

    per_day: float
    interval: tuple[float, float]
    reaches_limit: Stamp | None = None
    interval_at: tuple[Stamp | None, Stamp | None] = (None, None)


class AssetFault(_Part):
    """What is wrong with one asset: `pump:2`, `main`, `main:line 1`, `sensor:pump2_flow_m3h`."""

    asset: str = Field(min_length=1, max_length=64)
    stage: Stage
    since: Stamp
    severity: Severity | None = None
    trend: Trend | None = None
    advice: str = Field("", max_length=500)


class Verdict(Message):
    """What the detector says of one pump after a run, or when its state changes.

    `probability` sums to one over the states that were weighed; `evidence` holds the figures that it rests on;
    `window` is the time that was judged. `faults` are those of the pump, its main and its meters that stand, the
    worst first, None where the sender does not tell them; `asset`, `stage`, `severity` and `trend` are of the worst.
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
