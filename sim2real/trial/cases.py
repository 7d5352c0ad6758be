"""The cases of a trial: which truth, which kind, each from the seed and its number alone.

Case k of seed S does not depend on how many there are. Kinds take turns; within a kind the names take turns in an
order that the seed shuffles, so that each is met as often as any other. Its truth can be drawn anew: another attempt
has the same names with another station, inflow and size.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from wetwell.sim2real.truth.case import TruthCase
from wetwell.sim2real.truth.deviations import DEVIATIONS, LIBRARY, OPEN
from wetwell.sim2real.truth.sampling import RAMPS_S, case_of
from wetwell.sim2real.truth.swmm_input import SWMM_LIBRARY, SWMM_OPEN, SWMM_RAMPS_S

CaseKind = Literal["single", "pair", "none", "open", "leave_one_out"]
PlantName = Literal["fine", "swmm"]
KINDS: tuple[CaseKind, ...] = get_args(CaseKind)
VERDICT_OF: dict[CaseKind, str] = {
    "single": "effect",
    "pair": "effect",
    "none": "none",
    "open": "unknown",
    "leave_one_out": "unknown",
}
_HELD: dict[tuple[PlantName, bool], tuple[str, ...]] = {
    ("fine", False): LIBRARY,
    ("fine", True): OPEN,
    ("swmm", False): SWMM_LIBRARY,
    ("swmm", True): SWMM_OPEN,
}
SLOW_SHARE = 0.3
"""Share of the variance of the sensors' noise that is slow, in every other case."""


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
    attempt : int
        From 0.
    """

    seed: int
    number: int
    kind: CaseKind
    plant: PlantName
    names: tuple[str, ...]
    seconds: int
    attempt: int = 0

    @property
    def name(self) -> str:
        """Name of the case, which says nothing of it."""
        return f"case-{self.number:04}"

    @property
    def components(self) -> tuple[str, ...]:
        """Components in which its deviations lie."""
        return tuple(DEVIATIONS[name].component for name in self.names)

    @property
    def inherent(self) -> tuple[str, ...]:
        """Effects that its plant always has to some degree: the mains of SWMM are not without inertia."""
        return ("water_inertia",) if self.plant == "swmm" else ()

    @property
    def without(self) -> tuple[str, ...]:
        """Effects that are taken out of the library for it."""
        return self.names if self.kind == "leave_one_out" else ()

    def truth(self) -> TruthCase:
        """Draw station, inflow and deviations: of `SeedSequence(S, spawn_key=(k,))`, of `(k, attempt)` later."""
        if self.attempt:
            rng = _stream(self.seed, self.number, self.attempt)
        else:
            rng = _stream(self.seed, self.number)
            if self.kind == "pair":
                _other(self.names[0], _HELD[self.plant, False], rng)  # this stream has drawn the name, too
        return case_of(
            self.names,
            f"station-{rng.integers(16**6):06x}",
            rng,
            seconds=self.seconds,
            slow_share=SLOW_SHARE if rng.random() < 0.5 else 0.0,
            ramps_s=SWMM_RAMPS_S if self.plant == "swmm" else RAMPS_S,
        )


def trial_case(
    seed: int, number: int, *, kinds: tuple[CaseKind, ...], plants: tuple[PlantName, ...], seconds: int
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

    Examples
    --------
    >>> case = trial_case(1, 7, kinds=("single", "none"), plants=("fine",), seconds=600)
    >>> case.kind, case.names, case.name
    ('none', (), 'case-0007')
    """
    turn, place = divmod(number, len(kinds))
    kind = kinds[place]
    plant = plants[turn % len(plants)]
    names = _names(seed, number, kind, plant, turn // len(plants))
    return TrialCase(seed=seed, number=number, kind=kind, plant=plant, names=names, seconds=seconds)


def _names(seed: int, number: int, kind: CaseKind, plant: PlantName, turn: int) -> tuple[str, ...]:
    if kind == "none":
        return ()
    held = _HELD[plant, kind == "open"]
    order = _stream(seed, KINDS.index(kind), len(held), 0)
    first = held[int(order.permutation(len(held))[turn % len(held)])]
    return (first, _other(first, held, _stream(seed, number))) if kind == "pair" else (first,)


def _other(first: str, held: tuple[str, ...], rng: np.random.Generator) -> str:
    """Second name of a pair, which lies in another component."""
    others = [name for name in held if DEVIATIONS[name].component != DEVIATIONS[first].component]
    return others[int(rng.integers(len(others)))]


def _stream(seed: int, *key: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
