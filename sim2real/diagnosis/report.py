"""The report of a diagnosis, as programs read it: schema `wetwell.gap-report/2`."""

from typing import Literal

from pydantic import Field

from wetwell.protocols.recordings.origin import StoredValue
from wetwell.sim2real.diagnosis.correction_report import CorrectionReport
from wetwell.sim2real.diagnosis.report_part import ReportPart, Short, ShortInterval
from wetwell.sim2real.experiments.reported import ProposedAct, RefusedAct
from wetwell.sim2real.recording.regimes import Regime
from wetwell.sim2real.residuals.bins import Signal
from wetwell.simulator.effects.effect import Component


class Where(ReportPart):
    """A cell of the gap: one signal in one regime.

    Parameters
    ----------
    component : str
        The one that is held responsible.
    signal : str
        What was measured: flow, head, power, level, or an event such as a start.
    regime : str
        What the station was doing.
    gap : float
        Size of the residuals in units of the sensors' noise; 1 is noise alone. [1]
    ci : (float, float)
        In which it lies with 95 %. [1]
    share : float
        Of all that departs by more than is allowed. [1]
    """

    component: Component
    signal: Signal
    regime: Regime
    gap: Short
    ci: ShortInterval
    share: Short


class FittedParameter(ReportPart):
    """A parameter of an effect.

    Parameters
    ----------
    value : float, int or str
        A size, or the pump, main or channel that the effect is confined to.
    ci : (float, float), optional
        In which the true size lies with 95 %; none for what is no size.
    unit : str
        Of the size; "1" for a share or factor.
    """

    value: Short | int | str
    ci: ShortInterval | None
    unit: str


class FoundEffect(ReportPart):
    """An accepted effect.

    Parameters
    ----------
    name : str
        In the library of effects.
    component : str
        On which it acts.
    equivalent : list of str
        Effects that these data cannot tell from it.
    parameters : dict of FittedParameter
        By name; of what differs, the value in the last recording, and those before as `name@1` and so on.
    differs : list of str
        Parameters that differ between recordings; all others are shared by them.
    """

    name: str
    component: Component
    equivalent: tuple[str, ...]
    differs: tuple[str, ...] = ()
    parameters: dict[str, FittedParameter]


class RankedCandidate(ReportPart):
    """An effect of the library, tried alone.

    Parameters
    ----------
    name : str
        In the library of effects.
    score : float
        By how much it lowers the sum of squared residuals on held-out cycles, in units of noise squared. [1]
    shrinkage : float
        Share of the gap that it closes alone. [1]
    shrinkage_ci : (float, float)
        In which that lies with 95 %. [1]
    """

    name: str
    score: Short
    shrinkage: Short
    shrinkage_ci: ShortInterval


class SignalGap(ReportPart):
    """Gap of one signal, in units of the sensors' noise.

    Parameters
    ----------
    before, after : float
        As configured, and with the effects; 1 is noise alone. [1]
    """

    before: Short
    after: Short


class Gap(ReportPart):
    """Gap on held-out cycles, in units of the sensors' noise.

    Parameters
    ----------
    before, after : float
        As configured, and with the effects. [1]
    floor : float
        What a perfect model would score. [1]
    shrinkage : float
        (before − after) / (before − floor). [1]
    shrinkage_ci : (float, float)
        In which that lies with 95 %, by resampling blocks of cycles. [1]
    by_signal : dict of SignalGap
        Of each signal.
    """

    before: Short
    after: Short
    floor: float
    shrinkage: Short
    shrinkage_ci: ShortInterval
    by_signal: dict[str, SignalGap]


class ClosedLoop(ReportPart):
    """The simulator running free under the recorded inflow.

    Parameters
    ----------
    level_nmae : float
        Mean absolute error of the level over its range. [1]
    starts_per_day : float
        Of all pumps. [1/d]
    run_h_per_day : float
        Of all pumps. [h/d]
    """

    level_nmae: float
    starts_per_day: float
    run_h_per_day: float


class ClosedLoopComparison(ReportPart):
    """What the station did, and what the simulator does when it runs free.

    Parameters
    ----------
    inflow : str
        Where the inflow comes from: measured, or worked out from level and flow.
    measured_starts_per_day : float
        Of all pumps of the station. [1/d]
    measured_run_h_per_day : float
        Of all pumps of the station. [h/d]
    before, after : ClosedLoop
        As configured, and with the effects.
    """

    inflow: str
    measured_starts_per_day: float
    measured_run_h_per_day: float
    before: ClosedLoop
    after: ClosedLoop


class DetectorVerdicts(ReportPart):
    """Verdicts of the detector that call a fault on the recording, taken to be healthy.

    The detector learns its baseline, so constant effects make little difference to it.

    Parameters
    ----------
    days : float
        Length of the recording that was judged. [d]
    verdicts : int
        Verdicts in it.
    false_per_day_before, false_per_day_after : float
        That call a fault, with the station as configured, and with the effects. [1/d]
    has_new_curves : bool
        Whether the effects change a curve that the detector takes its residuals from; if not, both are the same run.
    """

    days: float
    verdicts: int
    false_per_day_before: float
    false_per_day_after: float
    has_new_curves: bool


class UntestedEffect(ReportPart):
    """An effect that the recording cannot show; "none" means none of the others.

    Parameters
    ----------
    effect : str
        In the library of effects.
    reason : str
        Why the recording cannot show it.
    """

    effect: str
    reason: str


class NoiseCheck(ReportPart):
    """How large what is left of a signal in a regime is under the answer.

    Parameters
    ----------
    signal : str
        What was measured.
    regime : str
        What the station was doing.
    mean_square : float
        Over what is expected of a good model; more in starts and stops, where a right one may be poor. [1]
    noise_share : float
        What the sensors alone make of that; a right answer lies between it and 1. [1]
    """

    signal: Signal
    regime: Regime
    mean_square: Short
    noise_share: Short


class AnswerProbability(ReportPart):
    """Probability of one answer.

    Parameters
    ----------
    effects : list of str
        The set of effects; empty for `none` and `unknown`.
    verdict : str
        Of which kind the answer is.
    probability : float
        Those of all answers sum to 1. [1]
    """

    effects: tuple[str, ...]
    verdict: Literal["effect", "none", "unknown"]
    probability: Short


class DiagnosedRecording(ReportPart):
    """One of the recordings that were diagnosed as one.

    Parameters
    ----------
    begin : str
        Its first row.
    hours : float
        Its length. [h]
    is_by_hand : bool
        Whether a crew commanded the pumps in some of it.
    """

    begin: str
    hours: Short
    is_by_hand: bool


class GapReport(ReportPart):
    """What `wetwell gap diagnose` writes.

    Parameters
    ----------
    schema : str
        Form of the report and its version.
    station : str
        Name of the station, as in its file.
    verdict : str
        `none`: nothing that could be tested differs by more than what matters; `effect`: a set of effects explains
        the recording; `unknown`: something differs that no effect explains.
    where : list of Where
        Where the gap lies, by share, the largest first; the first names the component that is held responsible.
    effects : list of FoundEffect
        Accepted effects, those that more likely act first, of equals the strongest; none for `none` and `unknown`.
    companions : list of FoundEffect
        What each station has, sized beside them: no part of the answer, but of the station that is written.
    posterior : list of AnswerProbability
        Each answer that is still possible, the most probable first.
    component_probability : dict
        That something is otherwise in a component. [1]
    noise_check : list of NoiseCheck
        Whether what is left under the answer is as large as noise and a right model make it.
    candidates : list of RankedCandidate
        Single effects, the best first.
    gap : Gap
        How far the simulator is off, before and after.
    correction : CorrectionReport, optional
        An equation for what no effect explains, where the verdict is `unknown` and one was found; else a note says
        why there is none.
    closed_loop : ClosedLoopComparison, optional
        The simulator running free; none where level or inflow do not allow it.
    detector : DetectorVerdicts, optional
        What the detector makes of the recording with both stations.
    signals : list of str
        What was measured and used.
    cycles : int
        Cycles of the recording, from start to start, that were used.
    rate_s : float
        From row to row of the recording. [s]
    value : str
        What a stored value stands for: an instant, the mean since the row before, or a value that held.
    not_tested : list of UntestedEffect
        Effects that this recording cannot show.
    notes : list of str
        What was out of order, and what is not measured.
    recordings : list of DiagnosedRecording
        What was diagnosed, in the order of time.
    experiments : list of ProposedAct
        Acts at the station that would tell apart what is left, the best first.
    refused : list of RefusedAct
        Acts that may not be done at the station.
    prior_stations : int
        Stations whose diagnoses were the prior of this one; 0 where effects and sizes were all alike before.
    next_experiment : str
        What to do next to learn more, in a sentence: the best act where there is one.
    """

    schema_: Literal["wetwell.gap-report/2"] = Field(default="wetwell.gap-report/2", alias="schema")
    station: str
    verdict: Literal["effect", "none", "unknown"]
    where: tuple[Where, ...]
    effects: tuple[FoundEffect, ...]
    companions: tuple[FoundEffect, ...] = ()
    posterior: tuple[AnswerProbability, ...] = ()
    component_probability: dict[str, Short] = Field(default_factory=dict)
    noise_check: tuple[NoiseCheck, ...] = ()
    candidates: tuple[RankedCandidate, ...]
    gap: Gap
    correction: CorrectionReport | None = None
    closed_loop: ClosedLoopComparison | None
    detector: DetectorVerdicts | None = None
    signals: tuple[str, ...]
    cycles: int
    rate_s: Short = 1.0
    value: StoredValue = "instant"
    not_tested: tuple[UntestedEffect, ...] = ()
    notes: tuple[str, ...] = ()
    recordings: tuple[DiagnosedRecording, ...] = ()
    experiments: tuple[ProposedAct, ...] = ()
    refused: tuple[RefusedAct, ...] = ()
    prior_stations: int = 0
    next_experiment: str
