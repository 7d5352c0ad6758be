"""The report of a diagnosis, as programs read it: schema `wetwell.gap-report/1`."""

from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from wetwell.sim2real.diagnosis.diagnosis import Diagnosis
from wetwell.sim2real.diagnosis.experiments import next_experiment
from wetwell.sim2real.diagnosis.shrinkage import FLOOR
from wetwell.simulator.effects.effect import Component

DIGITS = 6
WITHOUT = {
    "inflow_m3h": "no inflow: what the level alone shows is never called unknown, errors of the balance are unseen",
    "level_m": "no level: nothing can be said of sump, controller and level sensor",
    "flow_m3h": "no flow: pump, rising main and head sensor are hard to tell apart",
    "head_m": "no head: pump, rising main and flow meter are hard to tell apart",
    "power_kw": "no power: nothing can be said of the power",
}
"""What a diagnosis cannot tell without a quantity."""
PARTS = "the recording is long: parts of four hours, spread over all of it, were diagnosed"


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


class Where(_Part):
    """A cell of the gap; `gap` in units of the sensors' noise, 1 is noise alone."""

    component: Component
    signal: str
    regime: str
    gap: float
    ci: tuple[float, float]
    share: float


class FittedParameter(_Part):
    """Value with 95 % interval; a number, or the pump or channel that the effect is confined to."""

    value: float | int | str
    ci: tuple[float, float] | None
    unit: str


class FoundEffect(_Part):
    """An accepted effect."""

    name: str
    component: Component
    equivalent: tuple[str, ...]
    parameters: dict[str, FittedParameter]


class RankedCandidate(_Part):
    """A single effect of the library: its score on held-out cycles, and how far it alone shrinks the gap."""

    name: str
    score: float
    shrinkage: float
    shrinkage_ci: tuple[float, float]


class SignalGap(_Part):
    """Gap of one signal."""

    before: float
    after: float


class Gap(_Part):
    """Gap on held-out cycles, in units of the sensors' noise."""

    before: float
    after: float
    floor: float
    shrinkage: float
    shrinkage_ci: tuple[float, float]
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


class GapReport(_Part):
    """What `wetwell gap diagnose` writes."""

    schema_: Literal["wetwell.gap-report/1"] = Field(default="wetwell.gap-report/1", alias="schema")
    station: str
    verdict: Literal["effect", "none", "unknown"]
    where: tuple[Where, ...]
    effects: tuple[FoundEffect, ...]
    candidates: tuple[RankedCandidate, ...]
    gap: Gap
    closed_loop: ClosedLoopComparison | None
    detector: DetectorVerdicts | None = None
    signals: tuple[str, ...]
    cycles: int
    notes: tuple[str, ...] = ()
    next_experiment: str


def report_of(
    diagnosis: Diagnosis,
    closed_loop: ClosedLoopComparison | None = None,
    detector: DetectorVerdicts | None = None,
    notes: tuple[str, ...] = (),
) -> GapReport:
    """Report of a diagnosis, numbers with few digits; `notes` come before those on what is not measured."""
    names = [cause.name for cause in diagnosis.causes]
    equivalent = [name for cause in diagnosis.causes for name in cause.equivalent]
    blamed = diagnosis.where[0].component if diagnosis.where else None
    return GapReport(
        station=diagnosis.station.name,
        verdict=diagnosis.verdict,
        where=tuple(
            Where(
                component=place.component,
                signal=place.signal,
                regime=place.regime,
                gap=_short(place.gap),
                ci=_both(place.ci),
                share=_short(place.share),
            )
            for place in diagnosis.where
        ),
        effects=tuple(
            FoundEffect(
                name=cause.name,
                component=cause.component,
                equivalent=cause.equivalent,
                parameters={
                    name: FittedParameter(value=value, ci=None, unit="") for name, value in cause.fixed.items()
                }
                | {
                    parameter.name: FittedParameter(
                        value=_short(parameter.value), ci=_both(parameter.ci), unit=parameter.unit
                    )
                    for parameter in cause.parameters
                },
            )
            for cause in diagnosis.causes
        ),
        candidates=tuple(
            RankedCandidate(name=name, score=_short(score), shrinkage=_short(share), shrinkage_ci=_both(ci))
            for name, score, share, ci in diagnosis.ranking
        ),
        gap=Gap(
            before=_short(diagnosis.gap.before),
            after=_short(diagnosis.gap.after),
            floor=FLOOR,
            shrinkage=_short(diagnosis.gap.shrinkage),
            shrinkage_ci=_both(diagnosis.gap.shrinkage_ci),
            by_signal={
                name: SignalGap(before=_short(before), after=_short(after))
                for name, (before, after) in diagnosis.gap.by_signal.items()
            },
        ),
        closed_loop=closed_loop,
        detector=detector,
        signals=tuple(diagnosis.gap.by_signal),
        cycles=int(diagnosis.regimes.cycle.max()),
        notes=(*notes, *_missing(diagnosis)),
        next_experiment=next_experiment(diagnosis.verdict, names, equivalent, blamed),
    )


def _missing(diagnosis: Diagnosis) -> tuple[str, ...]:
    traces = diagnosis.traces
    measured = {*traces.signals, *(("inflow_m3h",) if traces.inflow_m3h is not None else ())}
    measured |= {"level_m"} if np.isfinite(traces.level_m).any() else set()
    parts = float(traces.time_s[-1]) + 1.0 > traces.seconds
    return tuple(text for name, text in WITHOUT.items() if name not in measured) + ((PARTS,) if parts else ())


def _short(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _both(pair: tuple[float, float]) -> tuple[float, float]:
    return _short(pair[0]), _short(pair[1])
