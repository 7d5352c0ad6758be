"""The judge of one pump: what its runs say, held against what it has learnt."""

import math
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wetwell.detector.baseline.healthy_reference import HealthyReference
from wetwell.detector.baseline.learning import Learning, sibling_rejection
from wetwell.detector.baseline.model import MIN_SEGMENTS
from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.inference.decision import decide, onset_component
from wetwell.detector.inference.observation import observe
from wetwell.detector.inference.posterior import (
    BOTH,
    FAULT_STATES,
    PUMP_FAULT,
    SYSTEM_FAULT,
    fault_scales,
)
from wetwell.detector.inference.prior import PumpPrior, SystemPrior, update_prior
from wetwell.detector.inference.weighing import OperatingPoint, Weighed, believe, remember_shown, weigh
from wetwell.detector.pump_memory import PumpMemory
from wetwell.detector.runs.run import Run, Segments
from wetwell.detector.sensors.sensor_faults import WAYS, doubtful_sensors, in_words, silencing_sensors
from wetwell.detector.statistics.robust import median
from wetwell.detector.stream.run_state import NEEDED
from wetwell.detector.stream.steady_samples import NO_FLOW_SHARE, SEGMENT_SAMPLES
from wetwell.detector.verdict.asset_faults import AssetFaults, StageRules
from wetwell.detector.verdict.evidence import run_evidence, shift_evidence
from wetwell.detector.verdict.maintenance import advice, expected_costs
from wetwell.detector.verdict.severity import severity
from wetwell.protocols.arrays import Floats
from wetwell.protocols.messages.verdict import AssetFault, Severity, State
from wetwell.protocols.station.costs import Costs

EARLY_PROBABILITY = 0.999
EARLY_SEGMENTS = 2
NOISE_WEIGHT = 0.05
CAUSE_OF: Mapping[str, tuple[State, ...]] = {
    "speed_loss_percent": ("pump_fault", "pump_and_system_fault", "unknown"),
    "friction_rise_percent": ("system_fault", "pump_and_system_fault", "unknown"),
    "static_head_rise_m": ("system_fault", "pump_and_system_fault", "unknown"),
}
"""States in which a severity is told that may stand for all that a pump without a head sensor shows."""


@dataclass(frozen=True, slots=True)
class Judgement:
    """What a verdict says, but for who says it and when."""

    state: State
    onset_ns: int | None
    window_ns: tuple[int, int]
    probability: Mapping[State, float]
    evidence: dict[str, Any]
    faults: tuple[AssetFault, ...] | None = None
    """Those that stand, where they are not those that are remembered."""


class PumpJudge:
    """Judges one pump: its runs, looks at one that goes on, and what is left of it without flow or frequency.

    Parameters
    ----------
    pump : int
        From 0.
    datasheet : Datasheet
        Of the station.
    costs : Costs
        For the expected cost of each act.
    rules : StageRules
        By which faults are staged.
    """

    def __init__(self, pump: int, datasheet: Datasheet, costs: Costs, rules: StageRules) -> None:
        self.memory = PumpMemory()
        self._pump = pump
        self._datasheet = datasheet
        self._curve = datasheet.curves[pump]
        self._friction_h2_m5 = datasheet.main_of(pump).friction_h2_m5
        self._needed = NEEDED | {"level_m"} if datasheet.main_of(pump).level_slope else NEEDED
        self._costs = costs
        self._faults = AssetFaults(pump, datasheet, rules)

    def faults(self, system: SystemPrior) -> tuple[AssetFault, ...]:
        """Faults of the pump, its main and its meters that stand, the worst first."""
        return self._faults.told(self.memory.prior.asset, system.asset, self.memory.wrong_meters)

    @property
    def name(self) -> str:
        """The pump as an asset."""
        return self._faults.pump_name

    @property
    def main_name(self) -> str:
        """Its main as an asset."""
        return self._faults.main_name

    def severity(self, asset: str, system: SystemPrior) -> Severity | None:
        """Severity of the pump or its main as it is now; None of other assets, and before the first run."""
        return self._faults.severity(asset, self.memory.prior.asset, system.asset)

    def tell(self, time_ns: int, reason: str) -> Judgement:
        """What was told last, with the reason why it is told again."""
        evidence: dict[str, Any] = {"reason": reason}
        if self.memory.reference is not None:
            evidence["baseline"] = self.memory.reference.version
        return self._judgement((time_ns, time_ns), {self.memory.state: 1.0}, evidence)

    def judge(self, run: Run, time_ns: int, system: SystemPrior, station: Sequence[PumpMemory]) -> Judgement:
        """Judge a run that has ended, or that has turned out to lack a signal.

        Parameters
        ----------
        run : Run
        time_ns : int
            When it is judged.
        system : SystemPrior
            Of the main; what the run says of it is taken in.
        station : sequence of PumpMemory
            Of all pumps: what is learnt must agree with the siblings.
        """
        memory = self.memory
        memory.early = None
        memory.cusum.reset()
        evidence: dict[str, Any] = {"steady_samples": len(run.time_s)}
        if run.missing:
            evidence["missing"] = sorted(run.missing)
        if not len(run.segments):
            return self._without_segment(run, evidence)
        memory.sees_flow_of_each |= bool(np.any(run.total_flow_m3h > run.flow_m3h))
        wrong = silencing_sensors(run, memory.reference)
        if wrong:
            return self._sensor_fault(run, evidence | wrong)
        if run.lacks_head and "head_m" not in run.missing:
            evidence["remark"] = "the head is measured now, and is not used: re-baseline the pump"
        if memory.learning is not None:
            self._learn(run, memory.learning, time_ns, station)
        rng = _generator(run)
        evidence |= run_evidence(run, self._datasheet, rng)
        if memory.reference is None:
            hidden = self._hidden_by_rate(run)
            memory.state = "unknown" if hidden else "learning"
            evidence["reason"] = hidden or (memory.learning.reason if memory.learning is not None else "")
            return self._judgement(run.window_ns, {memory.state: 1.0}, evidence)
        siblings = [each.prior for each in self._on_the_same_main(station)]
        return self._compare(run, memory.reference, system, siblings, evidence, rng)

    def lacking(self, run: Run) -> frozenset[str]:
        """Signals without which a run cannot be judged, and which it lacks."""
        return run.missing & (self._needed - {"head_m"} if run.lacks_head else self._needed)

    def does_without_head(self, run: Run) -> bool:
        """Whether what comes after a run is judged without a head sensor.

        So it is where flow and frequency are measured, and no run of the pump has had a head so far; to the end of
        the baseline that is learnt then.
        """
        if run.lacks_head:
            return self.memory.learning is None or "head_m" in run.missing
        is_new = self.memory.reference is None and self.memory.offset_m is None
        return is_new and self.lacking(run) == {"head_m"}

    def begin_learning(self) -> None:
        """Begin the learning anew, as where a head comes that was missing so far."""
        self.memory.learning = Learning()

    def segments_since_change(self, last: Segments) -> int:
        """Segments of the open run since a change that is worth a look, by the last of them; 0 without one."""
        memory = self.memory
        if memory.reference is None:
            return 0
        baseline = memory.reference.baseline
        deviation_m = np.sqrt(baseline.noise(last).diagonal() + baseline.run_covariance.diagonal())
        since = memory.cusum.update(baseline.shifts(last)[0], deviation_m)
        if since >= EARLY_SEGMENTS:
            return since
        memory.early = None
        return 0

    def look_early(self, run: Run, system: SystemPrior) -> Judgement | None:
        """Judge the last segments of an open run, if two looks in a row are sure of a fault not told yet.

        Such a run has no drawdown yet.
        """
        memory = self.memory
        reference = memory.reference
        if reference is None or run.stuck:
            memory.early = None
            return None
        is_dry = median(run.total_flow_m3h) < NO_FLOW_SHARE * self._datasheet.runout_flow_m3h(self._pump)
        if is_dry and math.isfinite(reference.drawdown.mean):
            return None  # the drawdown will tell at the end of the run whether the flow meter is dead
        evidence: dict[str, Any] = {"steady_samples": len(run.time_s), "early": True}
        weighed = self._weigh(run, reference, system, evidence)
        posterior = weighed.posterior
        state, remark = decide(posterior, weighed.point.head_m)
        fault = posterior.probability[[PUMP_FAULT, SYSTEM_FAULT, BOTH]].sum()
        previous, memory.early = memory.early, state if state in FAULT_STATES and fault > EARLY_PROBABILITY else None
        if memory.early is None or memory.early != previous or state == memory.state:
            return None
        rng = _generator(run)
        memory.recent.append((sum(run.window_ns) // 2, posterior.shift_m))
        memory.tell(state, run.window_ns, onset_component(state))
        memory.recent.pop()
        evidence |= run_evidence(run, self._datasheet, rng)
        evidence |= self._index(run, reference, rng)
        evidence |= self._consequences(run, reference, weighed, posterior.by_state(), state, remark)
        pump, main = deepcopy(memory.prior.asset), deepcopy(system.asset)  # the whole run will be taken in at its end
        believe(pump, main, weighed, state, memory.onset_ns or run.window_ns[0])
        for asset, copy in ((memory.prior.asset, pump), (system.asset, main)):
            asset.since_ns, asset.told_size = copy.since_ns, copy.told_size
        judgement = self._judgement(run.window_ns, posterior.by_state(), evidence)
        return replace(judgement, faults=self._faults.told(pump, main, memory.wrong_meters))

    def watch_missing(self, gathered: Any, lacking: list[str], time_ns: int) -> Judgement | None:
        """Judge a pump that lacks signals by a full segment of `new_missing_signals`, where what is off changes."""
        if not self.memory.missing_signals.update(gathered):
            return None
        now = time_ns, time_ns
        self.memory.tell("unknown", now, None)
        evidence = {"early": True, "missing": lacking, "reason": _missing_reason(lacking)}
        evidence |= self.memory.missing_signals.evidence(int(gathered["running"]))
        return self._judgement(now, {"unknown": 1.0}, evidence)

    def _without_segment(self, run: Run, evidence: dict[str, Any]) -> Judgement:
        """Judge a run without a segment."""
        memory, lacking = self.memory, sorted(self.lacking(run))
        is_learnt = memory.reference is not None
        is_of_all = self._has_one_meter(run, lacking)
        if lacking and is_learnt and not is_of_all:
            return self._sensor_fault(run, evidence | {"lost": lacking})
        few = f"fewer than {run.segments.samples} steady samples"
        evidence["reason"] = _missing_reason(lacking) if lacking else few
        if lacking == ["head_m"] and self.does_without_head(run):
            evidence["reason"] = "without head_m the next runs are judged by flow, speed and the main's datasheet"
        if is_of_all:
            evidence["reason"] = "nobody measures the flow of each while several pumps run on one main"
        if lacking or is_learnt:
            memory.tell("unknown", run.window_ns, None)
        if lacking:
            evidence |= memory.missing_signals.evidence(run.running)
        hidden = self._hidden_by_rate(run)
        if hidden and not lacking:
            evidence["reason"] = hidden
            memory.tell("unknown", run.window_ns, None)
        return self._judgement(run.window_ns, {memory.state: 1.0}, evidence)

    def _has_one_meter(self, run: Run, lacking: list[str]) -> bool:
        """Whether the flow may be missing because one meter is there for all pumps of the main.

        So it is where none was ever seen beside another pump. A meter that fails then is told by the next run alone.
        """
        is_beside = self._datasheet.main_of(self._pump).is_common_header and not run.lacked_flow_alone
        return is_beside and lacking == ["flow_m3h"] and not self.memory.sees_flow_of_each

    def _hidden_by_rate(self, run: Run) -> str | None:
        """Why nothing can be learnt of a pump: a slow feed has shown no run in a day that is long enough."""
        learning = self.memory.learning
        is_slow = run.segments.samples < SEGMENT_SAMPLES
        if not is_slow or learning is None or not learning.is_empty(run.seen_s - self.memory.began_s):
            return None
        rows = MIN_SEGMENTS * run.segments.samples
        return f"no run of the last day had {rows} steady rows, with one in {run.step_s:.0f} s"

    def _sensor_fault(self, run: Run, evidence: dict[str, Any]) -> Judgement:
        """Judge a run of which a sensor is wrong without doubt."""
        self.memory.tell("sensor_fault", run.window_ns, None)
        self.memory.blame_meters(_errors_of(evidence), run.window_ns[0])
        evidence["advice"] = advice("sensor_fault", in_words(evidence))
        return self._judgement(run.window_ns, {"sensor_fault": 1.0}, evidence)

    def _learn(self, run: Run, learning: Learning, time_ns: int, station: Sequence[PumpMemory]) -> None:
        baseline = self.memory.learn(learning, run, self._curve, self._friction_h2_m5)
        if baseline is None:
            return
        rejection = sibling_rejection(self._pump, [pump.offset_m for pump in station], self._datasheet.curves)
        if rejection is None:
            self.memory.settle(learning, baseline, time_ns, run.seen_s)
        else:
            learning.reason = rejection

    def _compare(
        self,
        run: Run,
        reference: HealthyReference,
        system: SystemPrior,
        siblings: Sequence[PumpPrior],
        evidence: dict[str, Any],
        rng: np.random.Generator,
    ) -> Judgement:
        """Judge a run by what was learnt."""
        memory = self.memory
        weighed = self._weigh(run, reference, system, evidence)
        posterior = weighed.posterior
        update_prior(posterior.probability, memory.prior, system, lacks_head=run.lacks_head, siblings=siblings)
        state, remark = decide(posterior, weighed.point.head_m)
        memory.recent.append((sum(run.window_ns) // 2, posterior.shift_m))
        wrong = doubtful_sensors(run, reference)
        evidence |= wrong
        if wrong and state not in FAULT_STATES:
            state, remark = "sensor_fault", in_words(wrong)
        memory.tell(state, run.window_ns, onset_component(state))
        memory.blame_meters(self._meter_errors(wrong, weighed, state), run.window_ns[0])
        believe(memory.prior.asset, system.asset, weighed, state, memory.onset_ns or run.window_ns[0])
        remember_shown(memory.prior, weighed, state)
        evidence |= self._index(run, reference, rng)
        if state == "normal":
            baseline = reference.baseline.with_noise_of(run.segments, NOISE_WEIGHT, self._curve[0])
            memory.reference = replace(reference, baseline=baseline)
            memory.limits.add(run.segments, baseline)
        probability = posterior.by_state()
        if state == "sensor_fault" and wrong:
            probability |= {"normal": 0.0, "sensor_fault": probability["normal"] + probability["sensor_fault"]}
        evidence |= self._consequences(run, reference, weighed, probability, state, remark)
        for asset in (memory.prior.asset, system.asset):
            if asset.since_ns is not None:
                asset.wasted_kwh[self._pump] = evidence["wasted_kwh_per_day"]
        return self._judgement(run.window_ns, probability, evidence)

    def _on_the_same_main(self, station: Sequence[PumpMemory]) -> list[PumpMemory]:
        """The other pumps that share its main."""
        mains = self._datasheet.main_of_pump
        return [each for pump, each in enumerate(station) if pump != self._pump and mains[pump] == mains[self._pump]]

    def _meter_errors(
        self, wrong: Mapping[str, Any], weighed: Weighed, state: State
    ) -> dict[str, tuple[float, float]]:
        """Relative error, and its standard deviation, of each meter that a verdict blames."""
        if state != "sensor_fault":
            return {}
        return _errors_of(wrong) or weighed.meter_error(self._pump)

    def _index(self, run: Run, reference: HealthyReference, rng: np.random.Generator) -> dict[str, Any]:
        """The paper's index of a run against its limits; nothing without a head sensor."""
        if run.lacks_head:
            return {}
        return {"index": self.memory.limits.figures(run.segments, reference.baseline, rng)}

    def _weigh(self, run: Run, reference: HealthyReference, system: SystemPrior, evidence: dict[str, Any]) -> Weighed:
        """Probability of each cause; what it rests on becomes part of the evidence."""
        observation = observe(run, reference, self._curve, self._friction_h2_m5)
        evidence |= shift_evidence(observation)
        evidence["baseline"] = reference.version
        return weigh(
            observation,
            fault_scales(self._datasheet, self._pump, reference.baseline),
            self.memory.prior,
            system,
            OperatingPoint(
                time_ns=run.window_ns[1],
                flow_m3h=float(median(run.segments.flow_m3h)),
                head_m=float(median(run.head_m)),
                friction_m=self._friction_h2_m5 * float(median(run.segments.total_m3h)) ** 2,
                run_covariance=reference.baseline.run_covariance,
            ),
        )

    def _consequences(
        self,
        run: Run,
        reference: HealthyReference,
        weighed: Weighed,
        probability: Mapping[State, float],
        state: State,
        remark: str | None,
    ) -> dict[str, Any]:
        """Severity, advice and expected costs."""
        posterior, point = weighed.posterior, weighed.point
        healthy_m3h = reference.baseline.explained_flows(run.segments)[0]
        power_kw = _mean_power(run.power_kw)
        run_share = run.run_s / max(run.seen_s, 1.0)
        wasted_kwh = power_kw * 24.0 * run_share * max(1.0 - point.flow_m3h / max(healthy_m3h, 1e-9), 0.0)
        figures = severity(posterior.shift_m, posterior.deviation_m, self._curve, point.flow_m3h, point.friction_m)
        if run.lacks_head:  # each as if it were the only cause
            figures = {name: figure for name, figure in figures.items() if state in CAUSE_OF[name]}
        return {
            "severity": figures,
            "advice": advice(state, remark),
            "wasted_kwh_per_day": round(wasted_kwh, 2),
            "cost": expected_costs(probability, wasted_kwh, self._costs),
        }

    def _judgement(
        self, window_ns: tuple[int, int], probability: Mapping[State, float], evidence: dict[str, Any]
    ) -> Judgement:
        memory = self.memory
        onset_ns = memory.onset_ns if memory.state in FAULT_STATES else None
        return Judgement(memory.state, onset_ns, window_ns, probability, evidence)


def _generator(run: Run) -> np.random.Generator:
    """What resamples of a run are drawn with: the same whenever it is judged."""
    return np.random.default_rng(abs(run.window_ns[0]) + run.pump)


def _mean_power(power_kw: Floats) -> float:
    """Mean of the readings that are known; 0 without any."""
    known = ~np.isnan(power_kw)
    if not known.any():
        return 0.0
    return float(np.where(known, power_kw, 0.0).sum() / np.count_nonzero(known))


def _errors_of(wrong: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """The same form as of meters that are off, for those that tell nothing."""
    return {name: (math.nan, math.nan) for how in WAYS for name in wrong.get(how, ())}


def _missing_reason(lacking: list[str]) -> str:
    return f"without {', '.join(lacking)} pump and system cannot be told apart"
