"""Probabilities of none, unknown and of sets of effects, given a recording."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import logsumexp

Verdict = Literal["effect", "none", "unknown"]

UNKNOWN_PRIOR = 1.0 / 3.0
"""Probability that something acts that the library does not hold: as likely as none, and as effects. [1]"""
NONE_PRIOR = 0.5
"""Probability that nothing of the library acts where nothing unknown does. [1]"""
FURTHER_PRIOR = 0.02
"""Ratio of the probability of a set with one more effect to that of the set without it. [1]"""
MISSED = 0.15
"""Probability that the truth is not among what was weighed: too small to be seen, or of another form. [1]"""
CREDIBLE = 0.95
"""Probability within which sets are not told apart. [1]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetProbability:
    """Probability of one answer; `effects` are in order of the alphabet, empty for `none` and `unknown`."""

    effects: tuple[str, ...]
    verdict: Verdict
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Weight:
    """A set of effects, none of them for `none`, with its evidence.

    Attributes
    ----------
    effects : tuple of str
        That it tells, in order of the alphabet.
    acting : tuple of str
        All that act in it: those, and companions that are too small to be told.
    log : float
        Logarithm of its evidence.
    log_flexible : float
        Of how much more probable the recording is if something unknown acts beside it; minus infinity where that
        was not computed, since the set is far behind.
    """

    effects: tuple[str, ...]
    acting: tuple[str, ...]
    log: float
    log_flexible: float


def posterior_of(
    weights: Sequence[Weight], library: int, log_share: Callable[[tuple[str, ...]], float] | None = None
) -> tuple[SetProbability, ...]:
    r"""Probabilities of the answers, best first; they sum to 1.

    $$P(S) = (1 - \epsilon) \frac{(1 - u)\,\pi_S\,L_S}{Z}, \qquad
    P(\text{unknown}) = \epsilon + (1 - \epsilon) \frac{u \sum_S \pi_S\,L_S F_S}{Z}, \qquad
    \pi_\emptyset = p_0, \quad \pi_S = (1 - p_0)\,q^{|S| - 1} / n$$

    with the evidence L, the flexible factor F, `UNKNOWN_PRIOR` u, `NONE_PRIOR` p₀, `FURTHER_PRIOR` q,
    n effects in the library, the sum Z of the numerators, and `MISSED` ε. The probability of an answer is the sum
    over all sets S that tell it.

    Parameters
    ----------
    weights : sequence of Weight
        One of them that of no effects.
    library : int
        Number of effects that are tested.
    log_share : callable, optional
        Logarithm of the share of a set among those of its size, in the place of 1 / n: `Priors.log_share`.

    Examples
    --------
    >>> far = Weight(effects=("ragging",), acting=("ragging",), log=-90.0, log_flexible=0.0)
    >>> best = posterior_of([Weight(effects=(), acting=(), log=0.0, log_flexible=-9.0), far], 25)[0]
    >>> best.verdict, round(best.probability, 2)
    ('none', 0.85)
    """
    priors = np.array([_log_prior(weight.acting, library, log_share) for weight in weights])
    sets = priors + np.array([weight.log for weight in weights])
    unknown = priors + np.array([weight.log + weight.log_flexible for weight in weights])
    logs = np.r_[np.log(1.0 - UNKNOWN_PRIOR) + sets, np.log(UNKNOWN_PRIOR) + logsumexp(unknown)]
    shares = (1.0 - MISSED) * np.exp(logs - logsumexp(logs))
    shares[-1] += MISSED
    answers: dict[tuple[str, ...], float] = {}
    for weight, share in zip(weights, shares[:-1], strict=True):
        answers[weight.effects] = answers.get(weight.effects, 0.0) + float(share)
    found = [
        SetProbability(effects=effects, verdict="effect" if effects else "none", probability=probability)
        for effects, probability in answers.items()
    ]
    found.append(SetProbability(effects=(), verdict="unknown", probability=float(shares[-1])))
    return tuple(sorted(found, key=lambda one: -one.probability))


def _log_prior(effects: tuple[str, ...], library: int, log_share: Callable[[tuple[str, ...]], float] | None) -> float:
    if not effects:
        return float(np.log(NONE_PRIOR))
    share = -np.log(max(library, 1)) if log_share is None else log_share(effects)
    return float(np.log(1.0 - NONE_PRIOR) + share + (len(effects) - 1) * np.log(FURTHER_PRIOR))


def verdict_of(posterior: Sequence[SetProbability]) -> Verdict:
    """The most probable verdict of what was weighed, all sets of effects together; `MISSED` decides none."""
    totals: dict[Verdict, float] = {"none": 0.0, "unknown": -MISSED, "effect": 0.0}
    for one in posterior:
        totals[one.verdict] += one.probability
    return max(totals, key=lambda verdict: totals[verdict])


def best_set(posterior: Sequence[SetProbability]) -> tuple[str, ...]:
    """The most probable set of effects; empty without any."""
    return next((one.effects for one in posterior if one.verdict == "effect"), ())


def equivalents(posterior: Sequence[SetProbability], effects: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """For each effect of a set those that take its place in other sets which the data do not rule out.

    Parameters
    ----------
    posterior : sequence of SetProbability
        Best first.
    effects : sequence of str
    """
    sets = [one for one in posterior if one.verdict == "effect"]
    total, told = sum(one.probability for one in sets), 0.0
    found: dict[str, list[str]] = {name: [] for name in effects}
    for one in sets:
        if told >= CREDIBLE * total:
            break
        told += one.probability
        gone, come = set(effects) - set(one.effects), set(one.effects) - set(effects)
        if len(gone) == len(come) == 1:
            found[gone.pop()].append(come.pop())
    return {name: tuple(others) for name, others in found.items()}
