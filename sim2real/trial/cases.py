"""The cases of a trial: which truth, which kind, each from the seed and its number alone.

Case k of seed S does not depend on how many there are. Kinds take turns; within a kind the names take turns in an
order that the seed shuffles, so that each is met as often as any other, and at each rate. Its truth can be drawn
anew: another attempt has the same names with another station, inflow and size.
"""

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from wetwell.protocols.quantities import AnalogueQuantity
from wetwell.protocols.recordings.origin import StoredValue
from wetwell.sim2real.trial.families import FAMILIES, Family, PlantName
from wetwell.sim2real.truth.case import TruthCase
from wetwell.sim2real.truth.storage import storage_of

CaseKind = Literal["single", "pair", "none", "open", "leave_one_out", "triple"]
KINDS: tuple[CaseKind, ...] = get_args(CaseKind)
VERDICT_OF: dict[CaseKind, str] = {
    "single": "effect",
    "pair": "effect",
    "none": "none",
    "open": "unknown",
    "leave_one_out": "unknown",
    "triple": "effect",
}
KNOWN_KINDS: tuple[CaseKind, ...] = ("single", "pair", "triple")
"""Kinds whose truth the library holds."""
_BESIDE: dict[CaseKind, int] = {"pair": 1, "triple": 2}
"""How many effects stand beside the first."""
SLOW_SHARE = 0.2
"""Share of the variance of the sensors' noise that is slow, in every other case."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StoragePlan:
    """How the recordings of a trial are stored; what else there is to storage each case draws for itself.

    Attributes
    ----------
    rates_s : tuple of int
        Seconds from row to row; they take turns. [s]
    values : tuple of "instant", "mean" or "held"
        What a row holds, at each rate.
    absent : tuple of quantities
        What no case has.
    metered_share : float
        Share of the cases that have an inflow meter. [1]
        Of what lies behind that meter all cases have one, if any has.
    """

    rates_s: tuple[int, ...] = (1,)
    values: tuple[StoredValue, ...] = ("instant",)
    absent: tuple[AnalogueQuantity, ...] = ()
    metered_share: float = 0.5

    @property
    def ways(self) -> tuple[tuple[int, StoredValue], ...]:
        """Each rate with each kind of value. [s, -]."""
        return tuple((rate_s, value) for rate_s in self.rates_s for value in self.values)

    @property
    def may_meter(self) -> bool:
        """Whether any case has an inflow meter."""
        return self.metered_share > 0.0 and "inflow_m3h" not in self.absent


DEFAULT_STORAGE = StoragePlan()
"""Instants of a row a second, half of the cases with an inflow meter."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialCase:
    """What one sealed case is, in an attempt to draw its truth.

    Attributes
    ----------
    seed, number : int
        S of the trial, and k, from 0.
    kind : CaseKind
    plant : PlantName
    names : tuple of str
        Of its deviations, the same in all attempts.
    seconds : int
        Length of its recording. [s]
    every_s : int
        Seconds from row to row. [s]
    value : "instant", "mean" or "held"
        What a row holds.
    absent : tuple of quantities
        What is not stored, or has no meter; of the inflow the case knows for itself.
    attempt : int
        From 0.
    """

    seed: int
    number: int
    kind: CaseKind
    plant: PlantName
    names: tuple[str, ...]
    seconds: int
    every_s: int = 1
    value: StoredValue = "instant"
    absent: tuple[AnalogueQuantity, ...] = ()
    attempt: int = 0

    @property
    def name(self) -> str:
        """Name of the case, which says nothing of it."""
        return f"case-{self.number:04}"

    @property
    def components(self) -> tuple[str, ...]:
        """Components in which its deviations lie."""
        return tuple(self.family.kinds[name].component for name in self.names)

    @property
    def family(self) -> Family:
        """Of its plant."""
        return FAMILIES[self.plant]

    @property
    def without(self) -> tuple[str, ...]:
        """Effects that are taken out of the library for it."""
        return self.names if self.kind == "leave_one_out" else ()

    def truth(self) -> TruthCase:
        """Draw station, inflow and deviations: of `SeedSequence(S, spawn_key=(k,))`, of `(k, attempt)` later.

        How it is stored is of a stream of its own, the same in all attempts.
        """
        if self.attempt:
            rng = _stream(self.seed, self.number, self.attempt)
        else:
            rng = _stream(self.seed, self.number)
            _others(self.names[:1], _BESIDE.get(self.kind, 0), self.family, rng)  # this stream has drawn them, too
        truth = self.family.case_of(
            self.names,
            f"station-{rng.integers(16**6):06x}",
            rng,
            seconds=self.seconds,
            slow_share=SLOW_SHARE if rng.random() < 0.5 else 0.0,
            every_s=self.every_s,
        )
        storage = storage_of(
            truth.station,
            _stream(self.seed, self.number, *_STORAGE),
            every_s=self.every_s,
            value=self.value,
            absent=self.absent,
        )
        return replace(truth, storage=storage)


def trial_case(
    seed: int,
    number: int,
    *,
    kinds: tuple[CaseKind, ...],
    plants: tuple[PlantName, ...],
    seconds: int,
    storage: StoragePlan = DEFAULT_STORAGE,
    effects: tuple[str, ...] = (),
) -> TrialCase:
    """Case `number` of the trial of a seed, in its first attempt.

    Parameters
    ----------
    seed, number : int
        S and k.
    kinds, plants : tuple
        They take turns.
    seconds : int
        Length of its recording. [s]
    storage : StoragePlan
    effects : tuple of str
        Of the library, one of which acts in each truth that the library holds; empty: any.

    Examples
    --------
    >>> case = trial_case(1, 7, kinds=("single", "none"), plants=("fine",), seconds=600)
    >>> case.kind, case.names, case.name
    ('none', (), 'case-0007')
    """
    turn, place = divmod(number, len(kinds))
    kind = kinds[place]
    turn, place = divmod(turn, len(plants))
    plant = plants[place]
    turn, place = divmod(turn, len(storage.ways))
    every_s, value = storage.ways[place]
    names = _names(seed, number, kind, plant, turn, effects, may_meter=storage.may_meter)
    is_behind_meter = any(FAMILIES[plant].kinds[name].is_behind_meter for name in names)
    has_meter = storage.may_meter and (
        is_behind_meter or _stream(seed, number, *_METERS).random() < storage.metered_share
    )
    unmetered: tuple[AnalogueQuantity, ...] = () if has_meter or "inflow_m3h" in storage.absent else ("inflow_m3h",)
    return TrialCase(
        seed=seed,
        number=number,
        kind=kind,
        plant=plant,
        names=names,
        seconds=seconds,
        every_s=every_s,
        value=value,
        absent=(*storage.absent, *unmetered),
    )


def _names(
    seed: int,
    number: int,
    kind: CaseKind,
    plant: PlantName,
    turn: int,
    effects: tuple[str, ...],
    *,
    may_meter: bool,
) -> tuple[str, ...]:
    if kind == "none":
        return ()
    family = FAMILIES[plant]
    held = family.open if kind == "open" else family.held_of(effects)
    if not may_meter:
        held = tuple(name for name in held if not family.kinds[name].is_behind_meter) or held
    order = _stream(seed, KINDS.index(kind), len(held), 0)
    first = held[int(order.permutation(len(held))[turn % len(held)])]
    return _others((first,), _BESIDE.get(kind, 0), family, _stream(seed, number))


def _others(names: tuple[str, ...], more: int, family: Family, rng: np.random.Generator) -> tuple[str, ...]:
    """Names and as many more, each in a component of its own."""
    for _ in range(more):
        taken = {family.kinds[name].component for name in names}
        others = [name for name in family.library if family.kinds[name].component not in taken]
        names = (*names, others[int(rng.integers(len(others)))])
    return names


_STORAGE, _METERS = (0, 1), (0, 2)
"""Ends of the keys of streams that are neither of an attempt nor of an order of names."""


def _stream(seed: int, *key: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
