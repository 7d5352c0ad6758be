"""What a diagnosis leaves open, as a file: enough to weigh acts again, under other prices or another inflow."""

from dataclasses import replace
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.protocols.recordings.origin import StoredValue
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.attribution.possible import PossibleSet
from wetwell.sim2real.experiments.conditions import Conditions
from wetwell.simulator.effects import AnyEffect
from wetwell.simulator.effects.effect import Effect

_EFFECTS: TypeAdapter[tuple[AnyEffect, ...]] = TypeAdapter(tuple[AnyEffect, ...])


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


class LeftSet(_Part):
    """A set of effects that may be the truth, with its parameters, and moved by a standard deviation each way."""

    effects: tuple[dict[str, Any], ...]
    probability: float
    spread: tuple[tuple[dict[str, Any], ...], ...]

    @property
    def possible(self) -> PossibleSet:
        """The set itself."""
        return PossibleSet(
            effects=_EFFECTS.validate_python(self.effects),
            probability=self.probability,
            spread=tuple(_EFFECTS.validate_python(moved) for moved in self.spread),
        )


class LeftOpen(_Part):
    """What `wetwell gap experiment` reads of a diagnosis: the station before it, and the sets that it leaves."""

    schema_: Literal["wetwell.gap-left-open/1"] = Field(default="wetwell.gap-left-open/1", alias="schema")
    station: Station
    inflow_m3h: float
    signals: tuple[AnalogueQuantity, ...]
    rate_s: float
    value: StoredValue
    sets: tuple[LeftSet, ...]

    @property
    def conditions(self) -> Conditions:
        """Under what an act would be played."""
        return Conditions(inflow_m3h=self.inflow_m3h, signals=self.signals, rate_s=self.rate_s, value=self.value)

    def conditions_under(self, inflow_m3h: float) -> Conditions:
        """The same under another inflow. [m³/h]."""
        return replace(self.conditions, inflow_m3h=inflow_m3h)


def left_open(station: Station, conditions: Conditions, sets: tuple[PossibleSet, ...]) -> LeftOpen:
    """What is left open, for a file."""
    return LeftOpen(
        station=station,
        inflow_m3h=conditions.inflow_m3h,
        signals=conditions.signals,
        rate_s=conditions.rate_s,
        value=conditions.value,
        sets=tuple(
            LeftSet(
                effects=_tables(one.effects),
                probability=one.probability,
                spread=tuple(_tables(moved) for moved in one.spread),
            )
            for one in sets
        ),
    )


def _tables(effects: tuple[Effect, ...]) -> tuple[dict[str, Any], ...]:
    return tuple(effect.model_dump() for effect in effects)
