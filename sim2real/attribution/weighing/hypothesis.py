"""A fit with its evidence."""

from dataclasses import dataclass

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.attribution.fitting import Fit
from wetwell.sim2real.likelihood.covariance import Form
from wetwell.sim2real.likelihood.evidence import Evidence


@dataclass(frozen=True, slots=True, kw_only=True)
class Hypothesis:
    """A fit with its evidence.

    Attributes
    ----------
    fit : Fit
    evidence : Evidence
    form : Form
    slopes : (cells, parameters) array
        Change of the residuals with each parameter, over its range.
    is_there : bool
        Whether none of its effects may be neutral, and none that is told could do another's work or widens the gap.
    told : tuple of str
        Its effects that matter, in order of the alphabet. The others are companions: too small for that, or
        never told.
    needed : tuple of str
        Those that matter, but for the one that the recording needs least, where it does not need it.
    """

    fit: Fit
    evidence: Evidence
    form: Form
    slopes: Floats
    is_there: bool
    told: tuple[str, ...]
    needed: tuple[str, ...]

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of its effects, in order of the alphabet."""
        return tuple(sorted(self.fit.names))

    @property
    def is_possible(self) -> bool:
        """Whether it may be the answer: each of its effects is there and matters."""
        return self.is_there and self.told == self.effects
