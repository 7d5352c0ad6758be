"""What a diagnosis reports of a correction: whether it is taken, its equation, sizes with intervals, a sentence."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.station.station_file import EffectTable
from wetwell.sim2real.attribution.intervals import TWO_SIDED
from wetwell.sim2real.correction.learning import Learnt
from wetwell.sim2real.correction.wording import UNITS_OF_TERMS, equation, name_of, sentence
from wetwell.sim2real.diagnosis.correction_report import CorrectionAddend, CorrectionReport, EquivalentTerm
from wetwell.sim2real.diagnosis.report import Gap
from wetwell.sim2real.diagnosis.shrinkage import gap_of
from wetwell.sim2real.residuals.bins import Bins
from wetwell.simulator.parameters import PlantParameters

LEAST_CLOSED = 0.5
"""Share of the gap that a correction surely closes: one that leaves the larger part is no explanation. [1]"""
LEAST_WIDTH = 0.03
"""Half width of an interval at the least, as a share of the size: the form of a shape is a guess. [1]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Correction:
    """A correction that a diagnosis has taken, with the gap on parts of the time that its sizes do not come from."""

    learnt: Learnt
    report: CorrectionReport
    gap: Gap

    @property
    def table(self) -> EffectTable:
        """Its table in a station file."""
        return EffectTable.model_validate(self.learnt.effect.model_dump(mode="json", exclude_none=True))


def weighed(
    learnt: Learnt | None, bins: Bins, plant: PlantParameters, rng: np.random.Generator
) -> tuple[Correction | None, str | None]:
    """The correction if it is taken, else why there is none.

    Parameters
    ----------
    learnt : Learnt, optional
        The most probable one.
    bins : Bins
    plant : PlantParameters
        Of the station as it is.
    rng : numpy.random.Generator
        Of the bootstrap.
    """
    if learnt is None:
        return None, "no correction of one term of the model is more probable than none"
    gap = gap_of(learnt.before, learnt.after, bins, np.ones(bins.size, dtype=np.bool_), rng)
    effect, reference = learnt.effect, learnt.effect.reference(plant)
    said = sentence(effect, reference)
    low, high = gap.shrinkage_ci
    if low < LEAST_CLOSED:
        return None, (
            f"no correction is taken: the most probable one closes {gap.shrinkage:.2f} ({low:.2f} to {high:.2f}) of "
            f"the gap on parts of the time that it was not fitted to, and not for sure {LEAST_CLOSED:g} of it: {said}"
        )
    report = CorrectionReport(
        term=effect.term,
        pump=effect.pump,
        main=effect.main,
        component=effect.place,
        covariates=tuple(dict.fromkeys(name_of(part) for part in effect.part)),
        equation=equation(effect, reference),
        sentence=said,
        addends=_addends(learnt, reference),
        shrinkage=gap.shrinkage,
        shrinkage_ci=gap.shrinkage_ci,
        equivalent=tuple(
            EquivalentTerm(term=one.term, component=one.place, equation=equation(one, one.reference(plant)))
            for one in learnt.equivalent
        ),
    )
    return Correction(learnt=learnt, report=report, gap=gap), None


def _addends(learnt: Learnt, reference: float) -> tuple[CorrectionAddend, ...]:
    effect, ends = learnt.effect, np.cumsum([0, 1, *(atom.columns.shape[1] for atom in learnt.atoms)])
    unit = UNITS_OF_TERMS.get(effect.term)
    scale = 1.0 if unit is None else reference
    names = [("offset", None), *((name_of(part), part.shape) for part in effect.part)]
    values = [effect.offset, *(part.size for part in effect.part)]
    found = []
    for k, ((name, shape), value) in enumerate(zip(names, values, strict=True)):
        own = slice(ends[k], ends[k + 1])
        spread = _spread(learnt.sizes[own], learnt.covariance[own, own])
        half = max(TWO_SIDED * spread, LEAST_WIDTH * abs(value))
        ci = (scale * (value - half), scale * (value + half))
        found.append(CorrectionAddend(covariate=name, shape=shape, size=scale * value, ci=ci, unit=unit or "1"))
    return tuple(found)


def _spread(sizes: Floats, covariance: Floats) -> float:
    """Standard deviation of a size; of a swing that of its amplitude."""
    along = sizes / max(float(np.linalg.norm(sizes)), 1e-12) if sizes.size > 1 else np.ones(1)
    return float(np.sqrt(along @ covariance @ along))
