"""The correction in the report of a diagnosis."""

from wetwell.sim2real.diagnosis.report_part import ReportPart, Short, ShortInterval
from wetwell.simulator.corrections.parts import Term
from wetwell.simulator.effects.effect import Component


class CorrectionAddend(ReportPart):
    """An addend of a correction.

    Parameters
    ----------
    covariate : str
        What it goes by: a covariate, a column by its name, or `offset` for one that is constant.
    shape : str, optional
        Name of its shape; none for an offset.
    size : float
        How large it is where its shape is 1.
    ci : (float, float)
        In which the true size lies with 95 %, if term and covariate are right.
    unit : str
        Of the size; "1" for a share of the term.
    """

    covariate: str
    shape: str | None
    size: Short
    ci: ShortInterval
    unit: str


class EquivalentTerm(ReportPart):
    """A correction of another term that says the same of the recording, for all that a right model may have wrong.

    Parameters
    ----------
    term : str
        The term that it corrects.
    component : str
        Where the cause lies if it is this one.
    equation : str
        With units.
    """

    term: Term
    component: Component
    equation: str


class CorrectionReport(ReportPart):
    """What is added to one term of the model where no effect of the library explains a gap.

    Parameters
    ----------
    term : str
        The term that is corrected.
    pump, main : int
        Of which pump or main, from 1; 0 for all.
    component : str
        Where the cause then lies.
    covariates : list of str
        What the correction goes by; empty for a constant.
    equation : str
        With units.
    sentence : str
        What it says, and what to look for.
    addends : list of CorrectionAddend
        The offset, then the others.
    shrinkage : float
        Share of the gap that it closes on parts of the time that its sizes do not come from. [1]
    shrinkage_ci : (float, float)
        In which that lies with 95 %. [1]
    equivalent : list of EquivalentTerm
        What the recording does not tell it from.
    """

    term: Term
    pump: int = 0
    main: int = 0
    component: Component
    covariates: tuple[str, ...]
    equation: str
    sentence: str
    addends: tuple[CorrectionAddend, ...]
    shrinkage: Short
    shrinkage_ci: ShortInterval
    equivalent: tuple[EquivalentTerm, ...] = ()
