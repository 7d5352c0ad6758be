"""The diagnosis: verdict, where the gap lies, which effects cause it, and how far it shrinks with them."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from wetwell.protocols.recordings.covariates import COVARIATE_PREFIX
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import EffectTable, Station
from wetwell.protocols.timestamps import NS_PER_S, to_iso
from wetwell.sim2real.attribution.attribution import Attribution, attribute
from wetwell.sim2real.attribution.candidates import candidates_of, usual_at
from wetwell.sim2real.attribution.trials import Each
from wetwell.sim2real.correction.learning import columns_of_no_use, learn
from wetwell.sim2real.diagnosis.components import component_probability, place_of_unknown
from wetwell.sim2real.diagnosis.correction import Correction, weighed
from wetwell.sim2real.diagnosis.findings import found_effects, noise_check, ranking, where_it_lies
from wetwell.sim2real.diagnosis.limitations import limitations
from wetwell.sim2real.diagnosis.localisation import localise
from wetwell.sim2real.diagnosis.report import (
    AnswerProbability,
    ClosedLoopComparison,
    DetectorVerdicts,
    DiagnosedRecording,
    FoundEffect,
    Gap,
    GapReport,
    RankedCandidate,
    UntestedEffect,
    Where,
)
from wetwell.sim2real.diagnosis.shrinkage import excess_that_matters, gap_of
from wetwell.sim2real.experiments.advice import next_experiment
from wetwell.sim2real.experiments.conditions import Conditions, conditions_of
from wetwell.sim2real.experiments.proposals import Proposals, proposals_of
from wetwell.sim2real.experiments.reported import proposed_acts, refused_acts
from wetwell.sim2real.likelihood.posterior import SetProbability, Verdict, verdict_of
from wetwell.sim2real.likelihood.priors import EVEN, Priors
from wetwell.sim2real.recording.excerpt import MOST_DIAGNOSED_S, MOST_OF_ROWS_S, excerpt
from wetwell.sim2real.recording.joining import joined
from wetwell.sim2real.recording.regimes import Regimes, regimes_of
from wetwell.sim2real.recording.traces import MIN_STARTS, Traces, check_starts, traces_of
from wetwell.sim2real.replay.plausibility import check_plausible
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.bins import Bins
from wetwell.sim2real.residuals.conditions import conditions_of as conditions_of_bins
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.simulator.effects import effects_of
from wetwell.simulator.effects.effect import Component
from wetwell.simulator.parameters import plant_parameters

FALLS = (
    "the level falls by up to {:.0f} cm while no pump runs: no inflow does that, so its sensor reads high now and "
    "then, or water leaves that nobody measures"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """All that is found; `station` is `own_station` with the effects, or the correction, added.

    `remarks` are on the correction and on columns; `attribution` and what follows are for drawings.

    `companions` are what each station has, and no answer. `own_effects` are the effects with their sizes
    by this recording alone, without what other stations say.
    `posterior` has the probability of each answer, best first, and sums to 1; `component_probability` that something
    is in a component, whether an effect of the library or something unknown. `seed` is that of all that is drawn.
    """

    verdict: Verdict
    where: tuple[Where, ...]
    effects: tuple[FoundEffect, ...]
    companions: tuple[FoundEffect, ...]
    own_effects: tuple[FoundEffect, ...]
    candidates: tuple[RankedCandidate, ...]
    gap: Gap
    correction: Correction | None
    remarks: tuple[str, ...]
    posterior: tuple[SetProbability, ...]
    component_probability: dict[Component, float]
    conditions: Conditions
    seed: int
    own_station: Station
    station: Station
    attribution: Attribution
    bins: Bins
    traces: Traces
    regimes: Regimes
    replay: Replay

    @property
    def suspects(self) -> tuple[str, ...]:
        """Components in which something unknown may lie: where its signals point, and those of the correction."""
        found = [one.component for one in self.where[:1]]
        if self.correction is not None:
            report = self.correction.report
            found += [report.component, *(one.component for one in report.equivalent)]
        return tuple(dict.fromkeys(found)) or ("station",)

    def proposals(self, each: Each = map) -> Proposals:
        """Acts that would tell apart what is left, under the conditions of the recording: each is simulated.

        Parameters
        ----------
        each : callable
            As `map`; that of a pool of threads weighs acts side by side.
        """
        left = self.attribution.possible if self.verdict != "unknown" else ()
        return proposals_of(self.own_station, left, self.conditions, seed=self.seed, each=each)

    def report(
        self,
        closed_loop: ClosedLoopComparison | None = None,
        detector: DetectorVerdicts | None = None,
        notes: tuple[str, ...] = (),
        prior_stations: int = 0,
        each: Each = map,
    ) -> GapReport:
        """What programs read; `notes` come before those on what is not measured; `each` weighs the proposals."""
        proposals = self.proposals(each)
        return GapReport(
            station=self.station.name,
            verdict=self.verdict,
            where=self.where,
            effects=self.effects,
            companions=self.companions,
            posterior=tuple(
                AnswerProbability(effects=one.effects, verdict=one.verdict, probability=one.probability)
                for one in self.posterior
            ),
            component_probability=self.component_probability,
            noise_check=noise_check(
                self.attribution, self.bins, conditions_of_bins(self.bins, self.traces, self.replay.station)
            ),
            candidates=self.candidates,
            gap=self.gap,
            correction=None if self.correction is None else self.correction.report,
            closed_loop=closed_loop,
            detector=detector,
            signals=tuple(self.gap.by_signal),
            cycles=int(self.regimes.cycle.max()),
            rate_s=self.traces.rate_s,
            value=self.traces.value,
            not_tested=tuple(
                UntestedEffect(effect=one.effect, reason=one.reason) for one in self.attribution.not_tested
            ),
            notes=(*notes, *self.remarks, *limitations(self.traces)),
            recordings=_recordings(self.traces),
            experiments=proposed_acts(proposals),
            refused=refused_acts(proposals),
            prior_stations=prior_stations,
            next_experiment=next_experiment(self.verdict, proposals.best, self.suspects),
        )


def diagnose(
    recording: Recording | Sequence[Recording],
    station: Station,
    *,
    only: Iterable[str] | None = None,
    without: Iterable[str] = (),
    seed: int = 0,
    progress: Callable[[float], None] = lambda _: None,
    each: Each = map,
    priors: Priors = EVEN,
) -> Diagnosis:
    """Diagnose the gap between a station and its recording, or several recordings taken as one.

    Parameters
    ----------
    recording : Recording, or sequence of Recording
        Prepared: times rise. Columns of truth are not read. Of several, some may be of acts by hand.
    station : Station
        What the simulator runs with; its own effects stay.
    only, without : names of effects
        Restrict the library.
    seed : int
        Of the bootstrap, and of what is simulated of acts.
    progress : callable
        Gets the share of the work that is done.
    each : callable
        As `map`; that of a pool of threads tries effects side by side.
    priors : Priors
        What other stations say of this one; even where they say nothing.

    Raises
    ------
    ValueError
        If recording and station do not fit, the recording is too short or in other units, or a name is not in the
        library.
    """
    counts, usual = (len(station.pump), len(station.mains)), usual_at(plant_parameters(station))
    library = candidates_of(*counts, usual=usual, only=only, without=without)
    is_external = station.control.is_external
    candidates = [each for each in library if not (is_external and each.component == "controller")]
    recordings = [recording] if isinstance(recording, Recording) else recording
    traces = _taken(recordings, station)
    regimes = regimes_of(traces, station)
    replay = Replay(traces, station, effects_of(station))
    plain = replay.run()
    check_plausible(traces, station, regimes, plain)
    residuals = StationResiduals(traces, station, regimes, plain, replay.doubt)
    bins = residuals.bins
    _check_compared(bins, traces)
    found = attribute(replay, residuals, regimes, candidates, progress, each, priors)
    verdict = verdict_of(found.posterior)
    rng = np.random.default_rng(seed)
    excess = excess_that_matters(found.plain, found.validation, bins)
    likeliest = max(found.unknown, key=lambda way: way.share, default=None)
    patterns = residuals.telemetry.components(() if likeliest is None else likeliest.acting)
    fall_m = 0.0 if found.falls is None else found.falls.far_m
    if fall_m > 0.0:
        patterns |= {"level_m": "level_sensor"}
    beside = excess_that_matters(found.beside, found.validation, bins)
    pattern = localise(beside, found.beside, bins, plain.plant, patterns)
    by_component = component_probability(found.posterior, found.unknown, pattern)
    unknown_at = place_of_unknown(found.unknown, pattern)
    blamed = unknown_at if found.accepted is None else found.accepted.candidates[0].component
    accepted = () if found.accepted is None else found.accepted.effects
    tables = [EffectTable.model_validate(effect.model_dump()) for effect in accepted]
    effects, told = found_effects(found.accepted, found.ends, found.equivalent), len(found.equivalent)
    correction: Correction | None = None
    columns = list(dict.fromkeys(name for one in recordings for name in one.covariates))
    remarks = [
        f"column '{COVARIATE_PREFIX}{name}' {why}: nothing is told by it"
        for name, why in columns_of_no_use(replay, bins, columns)
    ]
    if verdict == "unknown":
        remarks += [FALLS.format(100.0 * fall_m)] if fall_m > 0.0 else []
        correction, why = weighed(learn(replay, residuals), bins, plain.plant, rng)
        tables += [] if correction is None else [correction.table]
        remarks += [] if why is None else [why]
    return Diagnosis(
        verdict=verdict,
        where=() if verdict == "none" else where_it_lies(found, bins, excess, blamed, rng),
        effects=effects[:told],
        companions=effects[told:],
        own_effects=found_effects(found.own, found.own_ends, found.equivalent)[:told],
        candidates=ranking(found, bins, rng),
        correction=correction,
        remarks=tuple(remarks),
        gap=gap_of(found.plain, found.after, bins, found.validation, rng),
        posterior=found.posterior,
        component_probability=by_component,
        conditions=conditions_of(traces, station),
        seed=seed,
        own_station=station,
        station=station.model_copy(update={"effect": (*station.effect, *tables)}),
        attribution=found,
        bins=bins,
        traces=traces,
        regimes=regimes,
        replay=replay,
    )


def _check_compared(bins: Bins, traces: Traces) -> None:
    """Refuse a recording of which nothing can be held against the simulator."""
    if bins.size == 0:
        raise ValueError(
            f"no row shows a pump that has run for a while, and rows of {traces.rate_s:g} s hide whole cycles of the "
            "wet well: nothing to hold the simulator against"
        )


def _taken(recordings: Sequence[Recording], station: Station) -> Traces:
    """What is diagnosed: parts of long recordings, one recording after the other, those of acts whole."""
    if len(recordings) == 1:
        return excerpt(traces_of(recordings[0], station))
    each = [traces_of(recording, station, least_starts=1) for recording in recordings]
    are_left_alone = sum(not traces.by_hand.is_commanding.any() for traces in each)
    most_s = (MOST_DIAGNOSED_S if each[0].is_each_second else MOST_OF_ROWS_S) // max(are_left_alone, 1)
    traces = joined([one if one.by_hand.is_commanding.any() else excerpt(one, most_s) for one in each])
    check_starts(traces.frequency_hz, MIN_STARTS, "the recordings have, without runs that one begins or ends with,")
    return traces


def _recordings(traces: Traces) -> tuple[DiagnosedRecording, ...]:
    """The recordings that were diagnosed as one."""
    found = []
    for part in range(int(traces.part.max()) + 1):
        rows = np.flatnonzero((traces.part == part) & traces.is_row)
        time_s = traces.time_s[rows]
        found.append(
            DiagnosedRecording(
                begin=to_iso(traces.start_ns + int(time_s[0] * NS_PER_S)),
                hours=float(time_s[-1] - time_s[0]) / 3600.0,
                is_by_hand=bool(traces.by_hand.is_commanding[rows].any()),
            )
        )
    return tuple(found)
