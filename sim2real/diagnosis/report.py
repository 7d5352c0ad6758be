"""The report of a diagnosis, as programs read it: schema `wetwell.gap-report/1`."""

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from wetwell.protocols.recordings.origin import StoredValue
from wetwell.simulator.effects.effect import Component

Short = Annotated[float, AfterValidator(lambda value: float(f"{value:.6g}"))]
"""A number of six digits: nobody needs more."""
Interval = tuple[float, float]
ShortInterval = tuple[Short, Short]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


class Where(_Part):
    """A cell of the gap; `gap` in units of the sensors' noise, 1 is noise alone."""

    component: Component
    signal: str
    regime: str
    gap: Short
    ci: ShortInterval
    share: Short


class FittedParameter(_Part):
    """Value with 95 % interval; a number, or the pump or channel that the effect is confined to."""

    value: Short | int | str
    ci: ShortInterval | None
    unit: str


class FoundEffect(_Part):
    """An accepted effect; `equivalent` names those that these data cannot tell from it."""

    name: str
    component: Component
    equivalent: tuple[str, ...]
    parameters: dict[str, FittedParameter]


class RankedCandidate(_Part):
    """A single effect of the library: its score on held-out cycles, and how far it alone shrinks the gap."""

    name: str
    score: Short
    shrinkage: Short
    shrinkage_ci: ShortInterval


class SignalGap(_Part):
    """Gap of one signal."""

    before: Short
    after: Short


class Gap(_Part):
    """Gap on held-out cycles, in units of the sensors' noise."""

    before: Short
    after: Short
    floor: float
    shrinkage: Short
    shrinkage_ci: ShortInterval
    by_signal: dict[str, SignalGap]


class ClosedLoop(_Part):
    """The simulator running free under the recorded inflow: error of the level over its range, starts, run time."""

    level_nmae: float
    starts_per_day: float
    run_h_per_day: float


class ClosedLoopComparison(_Part):
    """Measured, and simulated before and after; None where it could not be run."""

    inflow: str
    measured_starts_per_day: float
    measured_run_h_per_day: float
    before: ClosedLoop
    after: ClosedLoop


class DetectorVerdicts(_Part):
    """Verdicts a day that call a fault on the recording, taken to be healthy, with both stations.

    `has_new_curves` says whether the effects change a curve that the detector takes its residuals from; if not, both
    are the same run. It learns its baseline: constant effects make little difference to it.
    """

    days: float
    verdicts: int
    false_per_day_before: float
    false_per_day_after: float
    has_new_curves: bool


class UntestedEffect(_Part):
    """An effect that the recording cannot show, and why; "none" means none of the others."""

    effect: str
    reason: str


class NoiseCheck(_Part):
    """Mean square of what is left of a signal in a regime under the answer, over what is expected of a good model.

    Between `noise_share`, what the sensors alone make, and 1 where the answer is right and the noise is known;
    more in starts and stops, where a right model may be poor.
    """

    signal: str
    regime: str
    mean_square: Short
    noise_share: Short


class AnswerProbability(_Part):
    """Probability of one answer: `none`, `unknown`, or a set of effects."""

    effects: tuple[str, ...]
    verdict: Literal["effect", "none", "unknown"]
    probability: Short


class GapReport(_Part):
    """What `wetwell gap diagnose` writes."""

    schema_: Literal["wetwell.gap-report/1"] = Field(default="wetwell.gap-report/1", alias="schema")
    station: str
    verdict: Literal["effect", "none", "unknown"]
    where: tuple[Where, ...]
    effects: tuple[FoundEffect, ...]
    posterior: tuple[AnswerProbability, ...] = ()
    component_probability: dict[str, Short] = {}
    noise_check: tuple[NoiseCheck, ...] = ()
    candidates: tuple[RankedCandidate, ...]
    gap: Gap
    closed_loop: ClosedLoopComparison | None
    detector: DetectorVerdicts | None = None
    signals: tuple[str, ...]
    cycles: int
    rate_s: Short = 1.0
    value: StoredValue = "instant"
    not_tested: tuple[UntestedEffect, ...] = ()
    notes: tuple[str, ...] = ()
    next_experiment: str
