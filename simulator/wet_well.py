"""The wet well: level and volume over its profile, and the overflow weir."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import compiled
from wetwell.simulator.records import Records, records_of

SECONDS_PER_HOUR = 3600
DAY_S = 86_400.0
WEIR_COEFFICIENT_M05_S = 1.84
"""Of a sharp-crested weir in metric units (Francis)."""


@dataclass(frozen=True, slots=True)
class ProfileSlice:
    """A slice of the wet well: level and area of its foot, growth of the area with height, the volume under it."""

    level_m: float
    area_m2: float
    slope_m: float
    volume_m3: float


def profile_of(points: Sequence[tuple[float, float]]) -> Records[ProfileSlice]:
    """Profile of points (level_m, area_m2), at least one, from the floor up; the area is linear between them.

    Examples
    --------
    >>> profile_of([(0.0, 2.0), (1.0, 4.0), (2.0, 4.0)])["volume_m3"]
    array([0., 3., 7.])
    """
    tops_m2 = [area_m2 for _, area_m2 in [*points[1:], points[-1]]]
    return profile_of_slices([(*point, top_m2) for point, top_m2 in zip(points, tops_m2, strict=True)])


def profile_of_slices(slices: Sequence[tuple[float, float, float]]) -> Records[ProfileSlice]:
    """Profile of slices (level_m, area_m2 at the foot, area_m2 at the top), from the floor up; the last is endless.

    Examples
    --------
    >>> profile_of_slices([(-1.0, 2.0, 2.0), (1.0, 4.0, 4.0)])["volume_m3"]
    array([0., 4.])
    """
    levels_m, areas_m2, tops_m2 = np.array(slices, dtype=float).T
    heights_m = np.diff(levels_m)
    slopes_m = np.concatenate([(tops_m2 - areas_m2)[:-1] / heights_m, [0.0]])
    volumes_m3 = np.concatenate([[0.0], np.cumsum((0.5 * (tops_m2 + areas_m2))[:-1] * heights_m)])
    return records_of([ProfileSlice(*each) for each in zip(levels_m, areas_m2, slopes_m, volumes_m3, strict=True)])


def areas_m2(profile: Records[ProfileSlice], levels_m: Floats) -> tuple[Floats, Floats]:
    """Areas at the feet and at the tops of the slices between levels; they differ where the walls have a step.

    Parameters
    ----------
    profile : records
    levels_m : (n,) array
        Rising, with all levels of the profile among them. [m]

    Returns
    -------
    feet_m2, tops_m2 : (n,) arrays
        Above each level, and under the one that follows; the last slice is endless. [m²]

    Examples
    --------
    >>> areas_m2(profile_of_slices([(0.0, 2.0, 2.0), (1.0, 4.0, 4.0)]), np.array([0.0, 0.5, 1.0]))
    (array([2., 2., 4.]), array([2., 2., 4.]))
    """
    k = np.searchsorted(profile["level_m"], levels_m, side="right") - 1
    feet_m2 = profile["area_m2"][k] + profile["slope_m"][k] * (levels_m - profile["level_m"][k])
    tops_m2 = profile["area_m2"][k] + profile["slope_m"][k] * (
        np.r_[levels_m[1:], levels_m[-1]] - profile["level_m"][k]
    )
    next_m2 = np.r_[feet_m2[1:], feet_m2[-1]]
    return feet_m2, np.where(np.isclose(tops_m2, next_m2), next_m2, tops_m2)


@compiled
def level_at_volume_m(volume_m3: float, profile: Records[ProfileSlice]) -> float:
    r"""Level at which the wet well holds a volume.

    Within a slice with area $a + s x$ at height x the volume is $a x + s x^2 / 2$, so that

    $$x = \frac{2 V}{a + \sqrt{a^2 + 2 s V}}$$

    Above the foot of the last slice its area goes on.

    Parameters
    ----------
    volume_m3 : float
        [m³]
    profile : records
        From `profile_of`. [m, m², m³]

    Examples
    --------
    >>> level_at_volume_m(3.0, profile_of([(0.0, 2.0), (1.0, 4.0)]))
    1.0
    """
    last = profile.size - 1
    if volume_m3 >= profile[last].volume_m3:
        above_m3 = volume_m3 - profile[last].volume_m3
        return profile[last].level_m + above_m3 / profile[last].area_m2
    k = last - 1
    while k > 0 and volume_m3 < profile[k].volume_m3:
        k -= 1
    rest_m3 = volume_m3 - profile[k].volume_m3
    area_m2 = profile[k].area_m2
    slope_m = profile[k].slope_m
    height_m = 2.0 * rest_m3 / (area_m2 + math.sqrt(area_m2**2 + 2.0 * slope_m * rest_m3))
    return profile[k].level_m + height_m


@compiled
def volume_at_level_m3(level_m: float, profile: Records[ProfileSlice]) -> float:
    """Volume in the wet well at a level: the inverse of `level_at_volume_m`.

    Examples
    --------
    >>> volume_at_level_m3(1.5, profile_of([(0.0, 2.0), (1.0, 4.0)]))
    5.0
    """
    last = profile.size - 1
    if level_m >= profile[last].level_m:
        above_m = level_m - profile[last].level_m
        return profile[last].volume_m3 + above_m * profile[last].area_m2
    k = last - 1
    while k > 0 and level_m < profile[k].level_m:
        k -= 1
    height_m = level_m - profile[k].level_m
    area_m2 = profile[k].area_m2
    slope_m = profile[k].slope_m
    return profile[k].volume_m3 + height_m * (area_m2 + 0.5 * slope_m * height_m)


@compiled
def overflow_m3h(level_m: float, crest_m: float, width_m: float, profile: Records[ProfileSlice]) -> float:
    r"""Flow over the overflow weir.

    $$Q = C\, b\, h^{3/2}, \qquad h = L - L_\text{crest}$$

    At most what stands above the crest leaves within a second.

    References
    ----------
    .. [1] J. B. Francis, Lowell Hydraulic Experiments, 1855: sharp-crested weir, C = 1.84 in metres and seconds.

    Examples
    --------
    >>> profile = profile_of([(0.0, 8.0)])
    >>> overflow_m3h(1.0, 2.0, 1.0, profile), round(overflow_m3h(2.25, 2.0, 1.0, profile), 3)
    (0.0, 828.0)
    """
    height_m = level_m - crest_m
    if height_m <= 0.0:
        return 0.0
    weir_m3h = WEIR_COEFFICIENT_M05_S * width_m * height_m * math.sqrt(height_m) * SECONDS_PER_HOUR
    above_m3 = volume_at_level_m3(level_m, profile) - volume_at_level_m3(crest_m, profile)
    return min(weir_m3h, above_m3 * SECONDS_PER_HOUR)


@compiled
def daily_swing_m3h(cosine_m3h: float, sine_m3h: float, clock_s: float) -> float:
    r"""What an inflow is above its mean at a time of the day.

    $$Q_c \cos\frac{2 \pi t}{24\,\text{h}} + Q_s \sin\frac{2 \pi t}{24\,\text{h}}$$

    Parameters
    ----------
    cosine_m3h, sine_m3h : float
        Q_c and Q_s, above the mean at midnight and at six. [m³/h]
    clock_s : float
        t, since a midnight. [s]

    Examples
    --------
    >>> round(daily_swing_m3h(1.0, 3.0, 21_600.0), 12)
    3.0
    """
    if cosine_m3h == 0.0 and sine_m3h == 0.0:
        return 0.0
    angle = 2.0 * math.pi * clock_s / DAY_S
    return cosine_m3h * math.cos(angle) + sine_m3h * math.sin(angle)


@compiled
def next_volume_m3(volume_m3: float, inflow_m3h: float, overflow_m3h: float, flow_m3h: Floats) -> float:
    r"""Volume one second later.

    $$\frac{dV}{dt} = Q_{in} - Q_\text{over} - \sum_i Q_i$$

    Where the pumps would take more than there is, their flows are reduced in place, all by the same factor, so that
    the wet well runs dry and no water is invented. An inflow may be negative, as where an observer takes some away;
    that takes no more than there is.

    Parameters
    ----------
    volume_m3 : float
        >= 0. [m³]
    inflow_m3h, overflow_m3h : float
        [m³/h]
    flow_m3h : (pumps,) array
        Flows out; reduced in place where the wet well runs dry. [m³/h]

    Examples
    --------
    >>> next_volume_m3(1.0, 36.0, 0.0, np.array([0.0]))
    1.01
    >>> flow_m3h = np.array([72.0])
    >>> next_volume_m3(0.01, 0.0, 0.0, flow_m3h), flow_m3h
    (0.0, array([36.]))
    """
    outflow_m3h = 0.0
    for i in range(flow_m3h.size):
        outflow_m3h += flow_m3h[i]
    volume_after_m3 = volume_m3 + (inflow_m3h - overflow_m3h - outflow_m3h) / SECONDS_PER_HOUR
    if volume_after_m3 >= 0.0:
        return volume_after_m3
    if outflow_m3h > 0.0:
        available_m3h = max(volume_m3 * SECONDS_PER_HOUR + inflow_m3h - overflow_m3h, 0.0)
        for i in range(flow_m3h.size):
            flow_m3h[i] *= available_m3h / outflow_m3h
    return 0.0
