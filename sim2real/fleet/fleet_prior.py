"""Prior of a station from the diagnoses of others: how usual effects are, and how their parameters are spread."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.special import stdtrit

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.attribution.candidates import candidates_of
from wetwell.sim2real.attribution.intervals import TWO_SIDED
from wetwell.sim2real.diagnosis.report import FoundEffect
from wetwell.sim2real.diagnosis.report_part import Short
from wetwell.sim2real.likelihood.priors import Priors

ADDED = 1.0
"""Stations that are thought to have each effect before any is diagnosed: Laplace's rule of succession. [1]"""
FEWEST_STATIONS = 3
"""Without which the spread of a parameter among stations is not known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """What a station was diagnosed with, without a prior of others: else it would be heard twice."""

    station: str
    effects: tuple[FoundEffect, ...]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


class UsualEffect(_Part):
    """How many stations have an effect, and how usual it is for a further one, relative to the mean of all."""

    stations: int
    weight: Short


class UsualParameter(_Part):
    """Mean and standard deviation of a parameter for a further station, and how many stations they come from."""

    mean: Short
    sd: Annotated[Short, Field(gt=0.0)]
    unit: str
    stations: int


class FleetPrior(_Part):
    """What `wetwell gap fleet` writes and `wetwell gap diagnose --prior` reads."""

    schema_: Literal["wetwell.gap-prior/1"] = Field(default="wetwell.gap-prior/1", alias="schema")
    stations: int
    effects: dict[str, UsualEffect]
    parameters: dict[str, dict[str, UsualParameter]]

    @property
    def priors(self) -> Priors:
        """As the likelihood takes it."""
        return Priors(
            weights={name: effect.weight for name, effect in self.effects.items()},
            parameters={
                effect: {name: (one.mean, one.sd) for name, one in found.items()}
                for effect, found in self.parameters.items()
            },
        )


def fleet_prior(findings: Sequence[Finding], without: str | None = None) -> FleetPrior:
    r"""Prior from the diagnoses of stations (empirical Bayes).

    $$w_e = \frac{k_e + 1}{\overline{k + 1}}, \qquad
    \tau^2 = \max\left(0, \frac{Q - (n - 1)}{c}\right) + \frac{\sqrt{2 (n - 1)}}{c}, \qquad
    s^2 = (\tau^2 + v_\mu) \left(\frac{t_{n - 1}}{1.96}\right)^2$$

    with the stations k that have an effect e; for a parameter of n stations, whose single errors are known, Cochran's
    Q, $c = \sum w - \sum w^2 / \sum w$ of the weights $w = 1 / \sigma_i^2$, and the variance v of the mean. The
    spread among stations τ² is raised by its own standard error; Student's t widens the whole where stations are few.

    Parameters
    ----------
    findings : sequence of Finding
    without : str, optional
        Station that is to be diagnosed: it is no witness of its own.

    References
    ----------
    .. [1] R. DerSimonian, N. Laird, Meta-analysis in clinical trials, Controlled Clinical Trials 7, 1986.
    .. [2] J. P. T. Higgins, S. G. Thompson, D. J. Spiegelhalter, A re-evaluation of random-effects meta-analysis,
       Journal of the Royal Statistical Society A 172, 2009 (what it says of a further one).
    """
    heard = [one for one in findings if one.station != without]
    free = _free_parameters()
    counts = {name: sum(name in {effect.name for effect in one.effects} for one in heard) for name in free}
    mean = float(np.mean([count + ADDED for count in counts.values()]))
    found: dict[str, dict[str, UsualParameter]] = {}
    for name, units in free.items():
        effects = [effect for one in heard for effect in one.effects if effect.name == name]
        for parameter, unit in units.items():
            values, errors = _values(effects, parameter)
            if values.size >= FEWEST_STATIONS:
                centre, sd = _spread(values, errors)
                found.setdefault(name, {})[parameter] = UsualParameter(
                    mean=centre, sd=sd, unit=unit, stations=values.size
                )
    return FleetPrior(
        stations=len(heard),
        effects={name: UsualEffect(stations=count, weight=(count + ADDED) / mean) for name, count in counts.items()},
        parameters=found,
    )


@cache
def _free_parameters() -> Mapping[str, Mapping[str, str]]:
    """Of each effect the units of its free parameters."""
    return {one.name: {each.name: each.unit for each in one.free} for one in candidates_of(1, 1)}


def _values(effects: Sequence[FoundEffect], parameter: str) -> tuple[Floats, Floats]:
    """(n,) values and standard errors of a parameter."""
    rows = [
        (float(one.value), (one.ci[1] - one.ci[0]) / (2.0 * TWO_SIDED))
        for effect in effects
        if (one := effect.parameters.get(parameter)) is not None and one.ci is not None and one.ci[1] > one.ci[0]
    ]
    values, errors = np.array(rows).reshape(-1, 2).T
    return values, errors


def _spread(values: Floats, errors: Floats) -> tuple[float, float]:
    """Mean, and standard deviation of what a further station has."""
    n, weight = values.size, errors**-2.0
    total = float(weight.sum())
    c = total - float(np.sum(weight**2)) / total
    q = float(np.sum(weight * (values - np.sum(weight * values) / total) ** 2))
    tau2 = max(0.0, (q - (n - 1)) / c) + np.sqrt(2.0 * (n - 1)) / c
    joint = 1.0 / (errors**2 + tau2)
    centre = float(np.sum(joint * values) / joint.sum())
    widened = -float(stdtrit(n - 1, 0.025)) / TWO_SIDED
    return centre, widened * float(np.sqrt(tau2 + 1.0 / joint.sum()))
