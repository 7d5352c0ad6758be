r"""What can be told apart: norms of signatures, what is left of one beside another, ranks.

A cause is visible if its signature at material size is at least `TELLING` units of noise. It is told from another if,
whatever size and form the other one can have, so much is left of it:

$$\min_\beta \left\lVert s_a - S_b\, \beta \right\rVert \ge T, \qquad \beta_0 \le \beta \le \beta_1$$

Two causes are told apart if this holds both ways, for each form. What is not told apart, directly or by way of
others, is a group.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from wetwell.protocols.arrays import Floats
from wetwell.protocols.quantities import SIGNALS, SensedQuantity
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.isolability.cause import CauseKind
from wetwell.sim2real.isolability.causes import causes_of
from wetwell.sim2real.isolability.duty_points import DutyPoint, control_points
from wetwell.sim2real.isolability.signatures import Signature, signatures_of
from wetwell.simulator.effects import effective_parameters

LINEAR = 0.02
"""Share of the material size at which signatures are taken: curvature is no mark of a cause. [1]"""
TELLING = 4.0
"""Units of noise that are no chance: of a few hundred comparisons, less than one in fifty goes so far by itself."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Telling:
    """What the signals say of one cause.

    Attributes
    ----------
    name, component : str
    kind : "effect" or "fault"
    size : float
        Length of its signature at material size, in units of noise; of its weakest form.
    is_visible : bool
    same_as : tuple of str
        Causes of its kind, visible too, from which it is not told apart.
    """

    name: str
    kind: CauseKind
    component: str
    size: float
    is_visible: bool
    same_as: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Isolability:
    """What can be told apart with some signals at some duty points.

    Attributes
    ----------
    signals : tuple of quantities
        That are measured, beside the frequency.
    points : int
        Number of duty points.
    causes : tuple of Telling
    ranks : dict of kind to int
        Sizes of causes of a kind that could be found at once, were all there: singular values over `TELLING`.
    groups : tuple of tuple of str
        Causes of one kind that are not told apart; only those of more than one.
    """

    signals: tuple[SensedQuantity, ...]
    points: int
    causes: tuple[Telling, ...]
    ranks: dict[CauseKind, int]
    groups: tuple[tuple[str, ...], ...]


def isolability(
    station: Station, signals: Collection[SensedQuantity], points: Sequence[DutyPoint] | None = None
) -> Isolability:
    """What can be told apart at a station.

    Parameters
    ----------
    station : Station
    signals : collection of quantities
        That are measured, beside the frequency.
    points : sequence of DutyPoint, optional
        Default: those that the station's control reaches.

    Raises
    ------
    ValueError
        If there is no duty point, or an effect does not fit the station.
    """
    plant = effective_parameters(station)
    at = control_points(station, plant) if points is None else tuple(points)
    signatures = signatures_of(plant, station, at, causes_of(station, plant, LINEAR), signals)
    return judged(signatures, tuple(name for name in SIGNALS.values() if name in signals), len(at))


def judged(signatures: Sequence[Signature], signals: tuple[SensedQuantity, ...], points: int) -> Isolability:
    """Which of the causes with these signatures are visible, and told apart from each other."""
    sizes = [float(np.linalg.norm(one.columns, axis=0).min(initial=np.inf)) for one in signatures]
    visible = [one for one, size in zip(signatures, sizes, strict=True) if size >= TELLING]
    same = {
        one.cause.name: tuple(
            other.cause.name
            for other in visible
            if other is not one and other.cause.kind == one.cause.kind and not are_told_apart(one, other)
        )
        for one in visible
    }
    kinds = dict.fromkeys(one.cause.kind for one in signatures)
    return Isolability(
        signals=signals,
        points=points,
        causes=tuple(
            Telling(
                name=one.cause.name,
                kind=one.cause.kind,
                component=one.cause.component,
                size=size,
                is_visible=one.cause.name in same,
                same_as=same.get(one.cause.name, ()),
            )
            for one, size in zip(signatures, sizes, strict=True)
        ),
        ranks={kind: _rank([one for one in visible if one.cause.kind == kind]) for kind in kinds},
        groups=_groups(same),
    )


def are_told_apart(one: Signature, other: Signature) -> bool:
    """Whether neither of two causes can be taken for the other, at material size."""
    return min(left_beside(one, other), left_beside(other, one)) >= TELLING


def left_beside(one: Signature, other: Signature) -> float:
    """What is left of a cause when another one is taken out as far as it goes; of its worst form. [noise]."""
    limits = other.cause.limits
    return min(
        math.sqrt(2.0 * lsq_linear(other.columns, sign * column, limits, method="bvls").cost)
        for column in one.columns.T
        for sign in one.cause.signs
    )


def _rank(signatures: Sequence[Signature]) -> int:
    if not signatures:
        return 0
    plain: Floats = np.column_stack([one.columns[:, 0] for one in signatures])
    return int(np.sum(np.linalg.svd(plain, compute_uv=False) >= TELLING))


def _groups(same: dict[str, tuple[str, ...]]) -> tuple[tuple[str, ...], ...]:
    """Sets of names that hang together."""
    left, groups = dict(same), []
    while left:
        group = [next(iter(left))]
        for name in group:
            group += [other for other in left.pop(name) if other not in group]
        groups.append(tuple(name for name in same if name in group))
    return tuple(group for group in groups if len(group) > 1)
