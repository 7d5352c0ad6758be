"""Where the recording is likeliest, from where the loss of a fit is least."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from wetwell.sim2real.attribution.fitting import ROUNDS
from wetwell.sim2real.attribution.weighing.hypothesis import Hypothesis
from wetwell.sim2real.attribution.weighing.scales import Scales

PARTS_OF_A_STEP = (1.0, 0.5, 0.25)
"""Parts of a step that are tried: slopes do not hold for all of it."""
WORTH_A_STEP = 1.0
"""By what a step has to make the recording likelier, in the logarithm: less tells no two sets apart."""


def settled(scales: Scales, one: Hypothesis) -> Hypothesis:
    """A hypothesis some steps along its slopes, as long as what is replayed there makes the recording likelier."""
    for _ in range(ROUNDS):
        if one.evidence.gained <= WORTH_A_STEP:
            break
        tried = [one]
        for its in _steps(scales, one):
            if its.evidence.log > one.evidence.log + WORTH_A_STEP:
                one = its
                break
            tried.append(its)
        else:
            return _as_replayed(tried)
    return one


def _steps(scales: Scales, one: Hypothesis) -> Iterator[Hypothesis]:
    """A hypothesis a step further, then half of it, and so on."""
    for part in PARTS_OF_A_STEP:
        position = one.fit.position + part * one.evidence.step
        moved = scales.fitter.at(one.fit.candidates, one.fit.split(position))
        if moved is not None:
            yield scales.weigh(moved)


def _as_replayed(tried: Sequence[Hypothesis]) -> Hypothesis:
    """The likeliest of places by what was replayed there: no step along the slopes keeps what they promise."""
    best = max(tried, key=lambda one: one.evidence.log - one.evidence.gained)
    return replace(best, evidence=replace(best.evidence, log=best.evidence.log - best.evidence.gained, gained=0.0))
