"""The wet well of a station file."""

from itertools import pairwise
from typing import Self

from pydantic import model_validator

from wetwell.protocols.station.table import Finite, NonNegative, Positive, Table


class Sump(Table):
    """The wet well, in one of three ways, and its overflow.

    Parameters
    ----------
    area_m2 : float, optional
        Area of the water, where it is the same at each level. [m²]
    profile : sequence of (level_m, area_m2), optional
        Beside `area_m2`: levels rise from 0, the area is linear between them. [m, m²]
    volume_points : sequence of (level_m, volume_m3), optional
        Instead of `area_m2`: at least two, levels and volumes rise; the area is constant between them, and goes on
        above the last. It goes on below the first too, down to where the wet well is empty: that is its floor.
        [m, m³]
    overflow_level_m, weir_width_m : float
        Crest and width of the weir. [m]
    """

    area_m2: Positive | None = None
    profile: tuple[tuple[Finite, Positive], ...] | None = None
    volume_points: tuple[tuple[Finite, NonNegative], ...] | None = None
    overflow_level_m: Finite | None = None
    weir_width_m: Positive = 1.0

    @model_validator(mode="after")
    def _check_shape(self) -> Self:
        if self.area_m2 is None and self.volume_points is None:
            raise ValueError("area_m2 is missing, or volume_points")
        if self.volume_points is not None:
            if self.area_m2 is not None or self.profile is not None:
                raise ValueError("give either 'area_m2' or 'volume_points'")
            _check_points(self.volume_points)
        levels_m = [level_m for level_m, _ in self.profile or ()]
        if levels_m and (levels_m[0] != 0.0 or any(low >= high for low, high in pairwise(levels_m))):
            raise ValueError(f"profile: levels must rise from 0, got {levels_m}")
        if self.profile is not None and not levels_m:
            raise ValueError("profile: at least one point (level_m, area_m2) is needed")
        if self.overflow_level_m is not None and self.overflow_level_m <= self.floor_level_m:
            raise ValueError(
                f"overflow_level_m: got {self.overflow_level_m:g}, must lie over the floor at {self.floor_level_m:g}"
            )
        return self

    @property
    def slices(self) -> tuple[tuple[float, float, float], ...]:
        """Slices from the floor up, each by the level of its foot and the areas at foot and top; the last is endless.

        [m, m², m²]

        Examples
        --------
        >>> Sump(area_m2=2.0, profile=((0.0, 2.0), (1.0, 4.0))).slices
        ((0.0, 2.0, 4.0), (1.0, 4.0, 4.0))
        >>> Sump(volume_points=((1.0, 10.0), (2.0, 30.0), (4.0, 50.0))).slices
        ((0.5, 20.0, 20.0), (2.0, 10.0, 10.0))
        """
        if self.volume_points is not None:
            levels_m = [self.floor_level_m, *(level_m for level_m, _ in self.volume_points[1:-1])]
            areas_m2 = _areas_m2(self.volume_points)
            return tuple(zip(levels_m, areas_m2, areas_m2, strict=True))
        points = self.profile or ((0.0, self.mean_area_m2),)
        tops_m2 = [area_m2 for _, area_m2 in (*points[1:], points[-1])]
        return tuple((*point, top_m2) for point, top_m2 in zip(points, tops_m2, strict=True))

    @property
    def floor_level_m(self) -> float:
        """Level at which the wet well is empty. [m]."""
        if self.volume_points is None:
            return 0.0
        level_m, volume_m3 = self.volume_points[0]
        return level_m - volume_m3 / _areas_m2(self.volume_points)[0]

    @property
    def mean_area_m2(self) -> float:
        """One area for the whole wet well: that of the file, or the mean over its points of volume. [m²].

        Examples
        --------
        >>> Sump(volume_points=((0.0, 0.0), (1.0, 4.0), (2.0, 20.0))).mean_area_m2
        10.0
        """
        if self.volume_points is not None:
            return _areas_m2((self.volume_points[0], self.volume_points[-1]))[0]
        if self.area_m2 is None:
            raise ValueError("sump: area_m2 is missing, or volume_points")
        return self.area_m2

    @property
    def middle_level_m(self) -> float:
        """Level halfway between the first and the last point that the file gives; 0 without points. [m]."""
        points = self.volume_points or self.profile or ((0.0, 0.0),)
        return 0.5 * (points[0][0] + points[-1][0])


def _check_points(points: tuple[tuple[float, float], ...]) -> None:
    if len(points) < 2:
        raise ValueError(f"volume_points: at least two points (level_m, volume_m3) are needed, got {len(points)}")
    for k, what in enumerate(("levels", "volumes")):
        values = [point[k] for point in points]
        if any(low >= high for low, high in pairwise(values)):
            raise ValueError(f"volume_points: {what} must rise, got {values}")


def _areas_m2(points: tuple[tuple[float, float], ...]) -> list[float]:
    """Area between each two neighbouring points of level and volume."""
    return [(high[1] - low[1]) / (high[0] - low[0]) for low, high in pairwise(points)]
