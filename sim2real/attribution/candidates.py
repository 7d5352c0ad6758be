"""Candidates of the diagnosis: each effect of the library, with what its class says can be varied."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.replay.changing import Acting, Changing
from wetwell.simulator.effects import COMPANIONS, EFFECTS, LIBRARY, effect_table
from wetwell.simulator.effects.effect import Component, Effect
from wetwell.simulator.parameters import PlantParameters

WIDE = 50.0
"""Ratio of a range's ends from which a parameter is varied on a logarithmic scale."""
STRENGTHS = (0.002, 0.01, 0.04, 0.12, 0.3)
"""Strengths that are tried first, as shares of the way from neutral to either end of the range."""

OF_TELEMETRY = {"report_by_exception", "level_quantisation"}
"""Effects that are seen by the pattern of the values: where there is none, there is no such effect."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeParameter:
    """A free parameter of an effect: its range, unit and start, its neutral value if it is a strength, and its forms.

    Forms are values between which no slope leads.
    """

    name: str
    unit: str
    low: float
    high: float
    start: float
    neutral: float | None
    forms: tuple[float, ...] = ()

    @property
    def is_logarithmic(self) -> bool:
        """Whether it is varied on a logarithmic scale."""
        return self.low > 0.0 and self.high / self.low >= WIDE

    def normalised(self, value: float) -> float:
        """Where a value lies in the range, 0 to 1."""
        if self.is_logarithmic:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def value(self, normalised: float) -> float:
        """Value at a normalised one."""
        normalised = min(max(normalised, 0.0), 1.0)
        if self.is_logarithmic:
            return float(self.low * (self.high / self.low) ** normalised)
        return self.low + (self.high - self.low) * normalised


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """An effect with what is fixed (a pump, a main, a channel) and what is free.

    Where there are several `periods`, a strength is free in each of them, named `strength@1` and so on.
    """

    name: str
    fixed: tuple[tuple[str, Any], ...]
    free: tuple[FreeParameter, ...]
    periods: int = 1

    @property
    def component(self) -> Component:
        """Component that the effect belongs to."""
        return EFFECTS[self.name].component

    @property
    def log_prior(self) -> float:
        """Logarithm of how probable it is among others of its kind, where not all are alike."""
        return 0.0

    @property
    def is_pattern(self) -> bool:
        """Whether the values themselves show how strong it is, whatever else there is: so it is tried."""
        return self.name in OF_TELEMETRY

    @property
    def is_layout(self) -> bool:
        """Whether its presence is its strength, such as that of a header: what others do, they do otherwise then."""
        return all(free.neutral is None for free in self.free)

    @property
    def is_limit(self) -> bool:
        """Whether readings pass its strength one by one."""
        return EFFECTS[self.name].is_limit

    @property
    def is_of_all(self) -> bool:
        """Whether each real station has some of it, and it is of all its pumps or mains."""
        return EFFECTS[self.name].is_everywhere and all(place == 0 for _, place in self.fixed)

    def effect(self, point: Floats) -> Effect:
        """Effect with its free parameters at a point, each normalised to its range; as it is in the last period."""
        return self._in_period(point, self.periods)

    def acting(self, point: Floats) -> Acting:
        """What acts at a point: the effect, or one in each period."""
        if self.periods == 1:
            return self.effect(point)
        return Changing(periods=tuple(self._in_period(point, k) for k in range(1, self.periods + 1)))

    def changing(self, periods: int) -> "Candidate":
        """The same with a strength for each period; what is no strength they share."""
        free = tuple(
            replace(one, name=name)
            for one in self.free
            for name in ([one.name] if one.neutral is None else [f"{one.name}@{k}" for k in range(1, periods + 1)])
        )
        return replace(self, free=free, periods=periods)

    def _in_period(self, point: Floats, period: int) -> Effect:
        values = dict(self.fixed)
        for free, one in zip(self.free, point, strict=True):
            name, _, number = free.name.partition("@")
            if number in {"", str(period)}:
                values[name] = free.value(float(one))
        return EFFECTS[self.name].model_validate(values)

    def neutral(self, point: Floats) -> Floats:
        """The point with all strengths neutral."""
        return np.array(
            [
                one if free.neutral is None else free.normalised(free.neutral)
                for free, one in zip(self.free, point, strict=True)
            ]
        )

    def start_grids(self, guess: Mapping[str, float], strengths: Sequence[float] = STRENGTHS) -> list[list[Floats]]:
        """Points to begin at: the guess, and grids of rising strength, each strength on both sides of neutral.

        The other strengths are neutral in a grid, as its scale is that of one. One that is neutral by the guess has
        no grid, nor has a pattern that the guess tells.
        """
        base = np.array(
            [free.normalised(min(max(guess.get(free.name, free.start), free.low), free.high)) for free in self.free]
        )
        if self.is_layout:
            return [[base], *([[np.full(base.size, 0.5)]] if base.size else [])]
        grids = [[base]] if any(free.name in guess for free in self.free) else []
        if grids and self.is_pattern:
            return grids
        still = self.neutral(base)
        for k, free in enumerate(self.free):
            if free.neutral is None or guess.get(free.name) == free.neutral:
                continue
            neutral = free.normalised(free.neutral)
            for end in (0.0, 1.0):
                if abs(end - neutral) > 1e-9:
                    grid = [still.copy() for _ in strengths]
                    for point, strength in zip(grid, strengths, strict=True):
                        point[k] = neutral + strength * (end - neutral)
                    grids.append(grid)
        return grids


def candidates_of(
    pumps: int,
    mains: int,
    *,
    usual: Mapping[str, float] | None = None,
    only: Iterable[str] | None = None,
    without: Iterable[str] = (),
) -> tuple[Candidate, ...]:
    """Candidates for a station: all that may be told, and what is sized beside it.

    Parameters
    ----------
    pumps, mains : int
        How many there are.
    usual : mapping of str to float
        What is usual at the station by its unit, as of `usual_at`: it says how far parameters are looked for.
    only, without : names of effects
        Restrict the library.

    Raises
    ------
    ValueError
        If a name is not in the library, or nothing is left.
    """
    wanted, dropped = {*LIBRARY, *COMPANIONS} if only is None else set(only), set(without)
    for name in (wanted - set(COMPANIONS)) | dropped:
        if name not in LIBRARY:
            raise ValueError(f"effect '{name}' is not in the library: see wetwell effects")
    if not wanted - dropped:
        raise ValueError("no effect of the library is left")
    counts = {"pump": pumps, "main": mains}
    found: list[Candidate] = []
    for row in effect_table():
        if row["name"] not in wanted - dropped:
            continue
        choices = {
            parameter["name"]: parameter.get("choices") or _numbers(counts[parameter["name"]])
            for parameter in row["parameters"]
            if "unit" not in parameter and (parameter["name"], mains) != ("main", 1)
        }
        free = tuple(
            _free_parameter(EFFECTS[row["name"]], parameter, usual or {})
            for parameter in row["parameters"]
            if "unit" in parameter
        )
        found += [
            Candidate(name=row["name"], fixed=tuple(zip(choices, picked, strict=True)), free=free)
            for picked in product(*choices.values())
        ]
    return tuple(found)


def usual_at(plant: PlantParameters) -> dict[str, float]:
    """Rated flow of the largest pump, and the inertia that its rated head moves to its rated flow in a second."""
    return {"m³/h": float(np.max(plant.rated_flow_m3h)), "s²/m²": float(np.max(plant.rated_inertia_s2_m2))}


def _numbers(count: int) -> list[int]:
    """All of them, then each; one alone is all."""
    return [0, *(range(1, count + 1) if count > 1 else ())]


def _free_parameter(effect: type[Effect], parameter: Mapping[str, Any], usual: Mapping[str, float]) -> FreeParameter:
    neutral = parameter.get("neutral")
    start = parameter.get("default", neutral)
    size, times = effect.reach.get(parameter["name"], (parameter["high"], 0.0))
    return FreeParameter(
        name=parameter["name"],
        unit=parameter["unit"],
        low=parameter["low"],
        high=min(parameter["high"], max(size, times * usual.get(parameter["unit"], 0.0))),
        start=float(parameter["low"] if start is None else start),
        neutral=neutral,
        forms=effect.forms.get(parameter["name"], ()),
    )
