"""Probabilities of none, unknown and of sets of effects, given a recording."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import expit, logsumexp, softmax

from wetwell.simulator.effects.effect import Component

Verdict = Literal["effect", "none", "unknown"]
Alike = Callable[[tuple[str, ...], Sequence[tuple[str, ...]]], Sequence[tuple[str, ...]]]
"""Those of some sets, in their order, that nothing parts from a set."""

UNKNOWN_PRIOR = 1.0 / 3.0
"""Probability that something acts that the library does not hold: as likely as none, and as effects. [1]"""
NONE_PRIOR = 0.5
"""Probability that nothing of the library acts where nothing unknown does. [1]"""
FURTHER_PRIOR = 0.02
"""Ratio of the probability of a set with one more effect to that of the set without it. [1]"""
MISJUDGED = 0.1
"""Probability that the likelihood takes unknown for known, or the other way round: what acts is too small to be seen
beside others, or of a form that is neither a known one nor what something unknown is taken for. [1]"""
CREDIBLE = 0.95
"""Probability within which sets are not told apart. [1]"""
DECIMALS = 6
"""Decimal places in which probabilities are equal. [1]"""


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


@dataclass(frozen=True, slots=True, kw_only=True)
class UnnamedWeight:
    """Something unknown that acts through a term of the model, with its evidence.

    Attributes
    ----------
    acting : tuple of str
        Effects beside which it acts.
    component : str
        In which it acts.
    log : float
        Logarithm of its evidence, and of its probability among all that may act so.
    log_flexible : float
        Of how much more probable the recording is if it has another form than the correction.
    is_apart : bool
        Whether a material difference parts it from each set; else it is that set under another name, and says no
        more than where something unknown would act.
    """

    acting: tuple[str, ...]
    component: Component
    log: float
    log_flexible: float
    is_apart: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class UnknownShare:
    """One way in which something unknown may act.

    Attributes
    ----------
    acting : tuple of str
        Effects beside which it acts.
    component : str or None
        In which it acts; None where it is a discrepancy of the readings.
    share : float
        Of the probability of something unknown.
    """

    acting: tuple[str, ...]
    component: Component | None
    share: float


def posterior_of(
    weights: Sequence[Weight],
    library: int,
    log_share: Callable[[tuple[str, ...]], float] | None = None,
    unnamed: Sequence[UnnamedWeight] = (),
) -> tuple[SetProbability, ...]:
    r"""Probabilities of the answers, best first; they sum to 1.

    $$U = \frac{u}{Z} \sum_S \pi_S \left(\tfrac12 L_S F_S
    + \tfrac12 \sum_T \rho_T\,L_{S,T}\,\tfrac12 (1 + F_{S,T})\right), \qquad
    P(\text{unknown}) = (1 - \epsilon)\, U + \epsilon\, (1 - U), \qquad
    P(S) = (1 - P(\text{unknown})) \frac{\pi_S\,L_S}{\sum_{S'} \pi_{S'}\,L_{S'}}, \qquad
    \pi_\emptyset = p_0, \quad \pi_S = (1 - p_0)\,q^{|S| - 1} / n$$

    with the evidence L of a set S, and of a correction T of a term beside it, of which ρ is probable; the flexible
    factor F, `UNKNOWN_PRIOR` u, `NONE_PRIOR` p₀, `FURTHER_PRIOR` q,
    n effects in the library, the sum Z of this numerator and of $(1 - u) \sum_S \pi_S\,L_S$, and `MISJUDGED` ε. The
    probability of an answer is the sum over all sets S that tell it.

    Parameters
    ----------
    weights : sequence of Weight
        One of them that of no effects.
    library : int
        Number of effects that are tested.
    log_share : callable, optional
        Logarithm of the share of a set among those of its size, in the place of 1 / n: `Priors.log_share`.
    unnamed : sequence of UnnamedWeight
        Corrections T that were weighed.

    Examples
    --------
    >>> far = Weight(effects=("ragging",), acting=("ragging",), log=-90.0, log_flexible=0.0)
    >>> best = posterior_of([Weight(effects=(), acting=(), log=0.0, log_flexible=-9.0), far], 25)[0]
    >>> best.verdict, round(best.probability, 2)
    ('none', 0.9)
    """
    priors = np.array([_log_prior(weight.acting, library, log_share) for weight in weights])
    sets = priors + np.array([weight.log for weight in weights])
    unknown = _logs_of_unknown(weights, [one for one in unnamed if one.is_apart], library, log_share)
    odds = np.log(0.5 * UNKNOWN_PRIOR / (1.0 - UNKNOWN_PRIOR)) + logsumexp(unknown) - logsumexp(sets)
    is_unknown = MISJUDGED + (1.0 - 2.0 * MISJUDGED) * float(expit(odds))
    shares = (1.0 - is_unknown) * np.exp(sets - logsumexp(sets))
    answers: dict[tuple[str, ...], float] = {}
    for weight, share in zip(weights, shares, strict=True):
        answers[weight.effects] = answers.get(weight.effects, 0.0) + float(share)
    found = [
        SetProbability(effects=effects, verdict="effect" if effects else "none", probability=probability)
        for effects, probability in answers.items()
    ]
    found.append(SetProbability(effects=(), verdict="unknown", probability=is_unknown))
    return tuple(sorted(found, key=lambda one: -one.probability))


def unknown_shares(
    weights: Sequence[Weight],
    library: int,
    log_share: Callable[[tuple[str, ...]], float] | None = None,
    unnamed: Sequence[UnnamedWeight] = (),
) -> tuple[UnknownShare, ...]:
    """How probable each way is in which something unknown may act, if it does; the parameters are of `posterior_of`.

    A correction that is a set under another name counts here: it says where.
    """
    places = [*((one.acting, None) for one in weights), *((one.acting, one.component) for one in unnamed)]
    shares = softmax(_logs_of_unknown(weights, unnamed, library, log_share))
    return tuple(
        UnknownShare(acting=acting, component=component, share=float(share))
        for (acting, component), share in zip(places, shares, strict=True)
    )


def _logs_of_unknown(
    weights: Sequence[Weight],
    unnamed: Sequence[UnnamedWeight],
    library: int,
    log_share: Callable[[tuple[str, ...]], float] | None,
) -> list[float]:
    """Logarithms of the probabilities of something unknown: as a discrepancy beside sets, then through the plant."""
    ways = [
        *((one.acting, one.log + one.log_flexible) for one in weights),
        *((one.acting, one.log + np.log(0.5) + np.logaddexp(0.0, one.log_flexible)) for one in unnamed),
    ]
    return [_log_prior(acting, library, log_share) + float(log) for acting, log in ways]


def shared(posterior: Sequence[SetProbability], alike: Alike) -> tuple[SetProbability, ...]:
    r"""Probabilities once sets that nothing parts share theirs as they were probable before anything was seen.

    $$P'(S) = \sum_{S' \in \{S\} \cup A(S)} P(S') \frac{q^{|S|}}{\sum_{S'' \in \{S'\} \cup A(S')} q^{|S''|}}$$

    with the sets A(S) that are alike S and the price q of a further effect, best first. Sets beyond `CREDIBLE` of the
    probability of all keep what they have: it is next to nothing. Of equal ones the likelier comes first.

    Parameters
    ----------
    posterior : sequence of SetProbability
        Best first.
    alike : callable
        Those of some sets that are alike one of them.
    """
    found = {one.effects: one.probability for one in posterior if one.verdict == "effect"}
    for one in credible(_sets_of(posterior)):
        others = alike(one.effects, [effects for effects in found if effects != one.effects])
        priors = {effects: FURTHER_PRIOR ** len(effects) for effects in (one.effects, *others)}
        found[one.effects] -= one.probability
        for effects, prior in priors.items():
            found[effects] += one.probability * prior / sum(priors.values())
    changed = [replace(one, probability=found[one.effects]) if one.verdict == "effect" else one for one in posterior]
    return tuple(sorted(changed, key=lambda one: -round(one.probability, DECIMALS)))


def credible(answers: Sequence[SetProbability]) -> list[SetProbability]:
    """The first of some answers, best first, until they have `CREDIBLE` of the probability of all of them."""
    before = np.cumsum([0.0, *(one.probability for one in answers)])
    return [one for one, told in zip(answers, before, strict=False) if told < CREDIBLE * before[-1]]


def _sets_of(posterior: Sequence[SetProbability]) -> list[SetProbability]:
    return [one for one in posterior if one.verdict == "effect"]


def _log_prior(effects: tuple[str, ...], library: int, log_share: Callable[[tuple[str, ...]], float] | None) -> float:
    if not effects:
        return float(np.log(NONE_PRIOR))
    share = -np.log(max(library, 1)) if log_share is None else log_share(effects)
    return float(np.log(1.0 - NONE_PRIOR) + share + (len(effects) - 1) * np.log(FURTHER_PRIOR))


def verdict_of(posterior: Sequence[SetProbability]) -> Verdict:
    """The most probable verdict by the likelihood, all sets of effects together; `MISJUDGED` decides none."""
    totals: dict[Verdict, float] = {"none": 0.0, "unknown": 0.0, "effect": 0.0}
    for one in posterior:
        totals[one.verdict] += one.probability
    known = totals["none"] + totals["effect"]
    totals["unknown"] = (totals["unknown"] - MISJUDGED) / (1.0 - 2.0 * MISJUDGED)
    for verdict in ("none", "effect"):
        totals[verdict] *= (1.0 - totals["unknown"]) / known
    return max(totals, key=lambda verdict: totals[verdict])


def best_set(posterior: Sequence[SetProbability], alike: Alike = lambda *_: ()) -> tuple[str, ...]:
    """Of the most probable set and those that are alike it the one of fewest effects; empty without any.

    Of as many effects it is the more probable one.
    """
    sets = [one.effects for one in posterior if one.verdict == "effect"]
    return min((sets[0], *alike(sets[0], sets[1:])), key=len) if sets else ()


def equivalents(posterior: Sequence[SetProbability], effects: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """For each effect of a set those that take its place in other sets which the data do not rule out.

    Parameters
    ----------
    posterior : sequence of SetProbability
        Best first.
    effects : sequence of str
    """
    found: dict[str, list[str]] = {name: [] for name in effects}
    for one in credible(_sets_of(posterior)):
        gone, come = set(effects) - set(one.effects), set(one.effects) - set(effects)
        if len(gone) == len(come) == 1:
            found[gone.pop()].append(come.pop())
    return {name: tuple(others) for name, others in found.items()}
