"""What a posterior leaves possible: sets of effects as they were fitted, and how far each may be off."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wetwell.sim2real.attribution.fitting import Fit
from wetwell.sim2real.attribution.hypotheses import Hypotheses
from wetwell.sim2real.attribution.weighing.hypothesis import Hypothesis
from wetwell.sim2real.likelihood.posterior import SetProbability, credible
from wetwell.simulator.effects.effect import Effect

MOST_SETS = 6
"""Sets that are kept, the most probable first."""
EVEN_VARIANCE = 1.0 / 12.0
"""Variance of a parameter that is even over its range, as a share of the square of the range."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PossibleSet:
    """A set of effects that may be the truth.

    Attributes
    ----------
    effects : tuple of Effect
        As they were fitted; empty where nothing acts.
    probability : float
    spread : tuple of tuple of Effect
        The set once for each independent direction of its parameters, moved along it by a standard deviation.
    """

    effects: tuple[Effect, ...]
    probability: float
    spread: tuple[tuple[Effect, ...], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Of its effects, in order of the alphabet."""
        return tuple(sorted(effect.name for effect in self.effects))


def possible_sets(hypotheses: Hypotheses, posterior: Sequence[SetProbability]) -> tuple[PossibleSet, ...]:
    """Sets within `CREDIBLE` of the probability of all that can be simulated, the most probable first.

    Parameters
    ----------
    hypotheses : Hypotheses
    posterior : sequence of SetProbability
        Best first; that something unknown acts cannot be simulated and is left out.
    """
    found = [
        PossibleSet(
            effects=hypothesis.fit.effects,
            probability=one.probability,
            spread=tuple(moved.effects for moved in _spread(hypothesis)),
        )
        for one in credible([one for one in posterior if one.verdict != "unknown"])[:MOST_SETS]
        for hypothesis in (hypotheses.of(one.effects),)
    ]
    return tuple(found)


def _spread(hypothesis: Hypothesis) -> list[Fit]:
    r"""The fit moved along the axes of its covariance, by a standard deviation each.

    $$\Sigma = \left(J^T C^{-1} J + 12 I\right)^{-1}$$

    in units of the ranges of the parameters, with the precision of the likelihood at the fit.
    """
    fit = hypothesis.fit
    if fit.position.size == 0:
        return []
    values, axes = np.linalg.eigh(hypothesis.evidence.precision + np.eye(fit.position.size) / EVEN_VARIANCE)
    moved = []
    for value, axis in zip(values, axes.T, strict=True):
        step = axis / np.sqrt(value)
        inside = np.clip(fit.position + step, 0.0, 1.0) - fit.position
        if np.linalg.norm(inside) < 0.5 * np.linalg.norm(step):  # at an end of the range it can go one way only
            inside = np.clip(fit.position - step, 0.0, 1.0) - fit.position
        moved.append(Fit(candidates=fit.candidates, points=fit.split(fit.position + inside), residuals=fit.residuals))
    return moved
