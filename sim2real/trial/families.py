"""Families of truth: plants that share no hydraulics with one another, and what each can do."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Literal, Protocol, get_args

import numpy as np

from wetwell.sim2real.truth import deviations, sampling
from wetwell.sim2real.truth.case import TruthCase
from wetwell.sim2real.truth.elastic import deviations as elastic_deviations
from wetwell.sim2real.truth.elastic import stations as elastic_stations
from wetwell.sim2real.truth.swmm_input import SWMM_LIBRARY, SWMM_OPEN, SWMM_RAMPS_S

PlantName = Literal["fine", "swmm", "elastic"]
PLANTS: tuple[PlantName, ...] = get_args(PlantName)


class DrawsCases(Protocol):
    """Draws a case with deviations of these names at a new station."""

    def __call__(
        self,
        names: tuple[str, ...],
        station_name: str,
        rng: np.random.Generator,
        *,
        seconds: int,
        slow_share: float,
        every_s: int,
    ) -> TruthCase:
        """As `sampling.case_of`."""


class Deviates(Protocol):
    """What of a way to deviate is the same in each family."""

    @property
    def component(self) -> str:
        """Where it lies."""

    @property
    def is_behind_meter(self) -> bool:
        """Whether it lies between the meter of the inflow and the wet well: without that meter it is nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """A family of truth.

    Attributes
    ----------
    library, open : tuple of str
        Deviations that are in the library of effects, and that are not.
    kinds : mapping of str
        Each of them.
    case_of : callable
    inherent : tuple of str
        Effects that its plant always has to some degree: to tell them is neither right nor wrong.
    """

    library: tuple[str, ...]
    open: tuple[str, ...]
    kinds: Mapping[str, Deviates]
    case_of: DrawsCases
    inherent: tuple[str, ...] = ()

    def held_of(self, effects: tuple[str, ...]) -> tuple[str, ...]:
        """Those of some effects that its plant can show, in its own order; without any all of its library."""
        return tuple(name for name in self.library if name in effects) if effects else self.library


_swmm_case_of: Callable[..., TruthCase] = partial(sampling.case_of, ramps_s=SWMM_RAMPS_S)
FAMILIES: dict[PlantName, Family] = {
    "fine": Family(
        library=deviations.LIBRARY,
        open=deviations.OPEN,
        kinds=deviations.DEVIATIONS,
        case_of=sampling.case_of,
    ),
    "swmm": Family(
        library=SWMM_LIBRARY,
        open=SWMM_OPEN,
        kinds=deviations.DEVIATIONS,
        case_of=_swmm_case_of,
        inherent=("water_inertia",),
    ),
    "elastic": Family(
        library=elastic_deviations.ELASTIC_LIBRARY,
        open=elastic_deviations.ELASTIC_OPEN,
        kinds=elastic_deviations.ELASTIC_DEVIATIONS,
        case_of=elastic_stations.case_of,
        inherent=("water_inertia",),
    ),
}
