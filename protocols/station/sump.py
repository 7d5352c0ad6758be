"""The wet well of a station file."""

from itertools import pairwise
from typing import Self

from pydantic import model_validator

from wetwell.protocols.station.table import Finite, Positive, Table


class Sump(Table):
    """The wet well: an area, or a profile of points (level, area) with the area linear between them; an overflow."""

    area_m2: Positive
    profile: tuple[tuple[Finite, Positive], ...] | None = None
    overflow_level_m: Positive | None = None
    weir_width_m: Positive = 1.0

    @model_validator(mode="after")
    def _check_profile(self) -> Self:
        levels_m = [level_m for level_m, _ in self.profile or ()]
        if levels_m and (levels_m[0] != 0.0 or any(low >= high for low, high in pairwise(levels_m))):
            raise ValueError(f"profile: levels must rise from 0, got {levels_m}")
        if self.profile is not None and not levels_m:
            raise ValueError("profile: at least one point (level_m, area_m2) is needed")
        return self
