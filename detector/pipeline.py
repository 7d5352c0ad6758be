"""The detector of one station: samples in, verdicts out; the same for a live stream and for a recording."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from wetwell.detector.baseline import Baseline
from wetwell.detector.belief import SystemBelief, joint_prior, remember
from wetwell.detector.decision import decide
from wetwell.detector.dispatch import Costs, advice, expected_costs
from wetwell.detector.drawdown import Drawdown
from wetwell.detector.evidence import f_test_figures, run_evidence, shift_evidence
from wetwell.detector.gate import Frame, Gate
from wetwell.detector.learning import sibling_objection
from wetwell.detector.meter_watch import RepeatWatch, noisy_meters
from wetwell.detector.nominal import Nominal
from wetwell.detector.observation import PUMP, SYSTEM, observe
from wetwell.detector.posterior import (
    BOTH,
    FAULTS,
    FLOW_METER,
    HEAD_SENSOR,
    NORMAL,
    PUMP_FAULT,
    SYSTEM_FAULT,
    Weighed,
    fault_scales,
    weigh,
)
from wetwell.detector.pump_record import Knowledge, PumpRecord
from wetwell.detector.runs import NEEDED, NO_FLOW_SHARE, Run, RunTracker
from wetwell.detector.severity import severity
from wetwell.detector.snapshot import decode_snapshot, encode_snapshot
from wetwell.protocols.messages import State, Verdict
from wetwell.protocols.readings import Readings
from wetwell.protocols.stamps import NS_PER_S

EARLY_PROBABILITY = 0.999
EARLY_SEGMENTS = 2
NOISE_WEIGHT = 0.05
WRONG = ("stuck", "dead", "lost", "noisy")
"""What a meter can be without any doubt."""
DEAD_LOG_RATIO = -1.5
"""A flow meter that shows less than a fifth of what leaves the wet well, against health, is dead."""
_STATE = ("_gate", "_runs", "_drawdown", "_repeats", "_system", "_pumps", "_seen_s", "_is_new")


class Detector:
    """Judges the pumps of one station.

    Gate, pump runs, learning, and for each run the probability of {normal, pump, system, both, wrong meter} from how
    far the level residuals lie from the learnt baseline, with the drawdown of the wet well and the power as further
    witnesses where they are measured. A verdict comes at the end of each run, when a state changes, and once for
    each pump when the first sample comes. Without flow, head and frequency no state can be told: the verdict is
    `unknown` and names what is missing.

    Memory: the segments of at most a day of learning, then the steady samples of one run. Warm-up: six hours of
    station time.

    Parameters
    ----------
    station : str
        Name for the verdicts.
    nominal : Nominal
        Datasheet curves.
    costs : Costs, optional
        For the expected cost of each act.
    """

    def __init__(self, station: str, nominal: Nominal, costs: Costs | None = None) -> None:
        self._station = station
        self._nominal = nominal
        self._costs = costs or Costs()
        self._gate = Gate(nominal)
        self._runs = RunTracker(nominal)
        self._drawdown = Drawdown(nominal.area_m2)
        self._repeats = RepeatWatch()
        self._system = SystemBelief()
        self._pumps = [PumpRecord() for _ in range(nominal.pumps)]
        self._seen_s = 0.0
        self._is_new = True

    @property
    def counts(self) -> dict[str, int]:
        """How many samples and values the gate has let through, marked or dropped."""
        return dict(self._gate.counts)

    def update(self, sample: Readings) -> tuple[Verdict, ...]:
        """Verdicts that a sample brings."""
        frame = self._gate.update(sample)
        if frame is None:
            return ()
        verdicts: list[Verdict] = []
        if self._is_new:
            self._is_new = False
            verdicts += [self._told(pump, frame.time_ns, (frame.time_ns,) * 2, "begins") for pump in self._every()]
        if math.isfinite(frame.gap_s):
            self._seen_s += frame.gap_s
        ended = self._runs.update(frame)
        running = self._runs.running
        is_any_running = True in running
        self._drawdown.update(frame, running)
        for run in ended + self._runs.newly_blind_runs() if is_any_running else ended:
            told_ns = max(frame.time_ns, run.window_ns[1])  # the clock may have been set back
            verdicts.append(self._judge(run, told_ns))
        verdicts += self._watch(frame, running)
        if not is_any_running:
            return tuple(verdicts)
        for index, steady in self._runs.steady_samples():
            self._pumps[index].rolling.update(frame.time_ns / NS_PER_S, *steady)
            verdicts += self._look_early(index, frame.time_ns)
        return tuple(verdicts)

    def finish(self) -> tuple[Verdict, ...]:
        """Verdicts on the runs that are still open at the end of a recording."""
        open_runs = [run for run in self._runs.finish() if len(run.segments) or run.missing & NEEDED]
        return tuple(self._judge(run, run.window_ns[1]) for run in open_runs)

    def snapshot(self) -> bytes:
        """The whole state, from which `restore` goes on bit for bit."""
        state = {name: getattr(self, name) for name in _STATE}
        return encode_snapshot(self._station, self._nominal, state)

    def restore(self, data: bytes) -> None:
        """Go on from a snapshot of the same station.

        Raises
        ------
        SnapshotError
            If it is damaged, of another format or station; this detector is left as it was.
        """
        for name, value in decode_snapshot(data, self._station, self._nominal).items():
            setattr(self, name, value)

    def rebaseline(self, pump: int, now_ns: int) -> Verdict:
        """Learn a pump (from 0) anew; what was learnt before is put aside and can be taken back."""
        self._pumps[pump].rebaseline(self._seen_s)
        self._system = SystemBelief()
        return self._told(pump, now_ns, (now_ns, now_ns), "re-baselined by an operator")

    def revert(self, pump: int, now_ns: int) -> Verdict:
        """Take the baseline of a pump (from 0) back that was put aside last; without one nothing changes."""
        is_back = self._pumps[pump].revert()
        reason = "baseline taken back by an operator" if is_back else "no baseline was put aside"
        return self._told(pump, now_ns, (now_ns, now_ns), reason)

    def _every(self) -> range:
        return range(len(self._pumps))

    def _told(self, index: int, time_ns: int, window_ns: tuple[int, int], reason: str) -> Verdict:
        pump = self._pumps[index]
        evidence: dict[str, Any] = {"reason": reason}
        if pump.known is not None:
            evidence["baseline"] = pump.known.version
        return self._verdict(index, time_ns, window_ns, {pump.state: 1.0}, evidence)

    def _watch(self, frame: Frame, running: tuple[bool, ...]) -> list[Verdict]:
        """Look at the readings by themselves; verdicts where that changes what is said of a pump without head."""
        verdicts = []
        self._repeats.update(frame, running, [pump.known is None for pump in self._pumps])
        for index, is_running in enumerate(running):
            if is_running:
                pump = self._pumps[index]
                pump.run_s += frame.gap_s if math.isfinite(frame.gap_s) else 0.0
                if self._repeats.stuck:
                    prefixes = ("level_m", f"pump{index + 1}_")
                    pump.stuck.update(name for name in self._repeats.stuck if name.startswith(prefixes))
                if pump.known is None and pump.blind.update(frame, index, running):
                    verdicts.append(self._tell_blind(index, frame))
        return verdicts

    def _tell_blind(self, index: int, frame: Frame) -> Verdict:
        """Verdict on a pump that cannot be judged, when it begins or ceases to run as it used to."""
        pump, now = self._pumps[index], (frame.time_ns, frame.time_ns)
        lacking = sorted(name for name in NEEDED if math.isnan(getattr(frame.pumps[index], name)))
        pump.take_state("unknown", now, None)
        evidence = {"early": True, "missing": lacking, "reason": _blind(lacking)} | pump.blind.evidence()
        return self._verdict(index, frame.time_ns, now, {"unknown": 1.0}, evidence)

    def _judge(self, run: Run, time_ns: int) -> Verdict:
        """Verdict on a run that has ended."""
        pump = self._pumps[run.pump]
        pump.early = None
        pump.cusum.reset()
        log_ratio = self._drawdown.take(run.pump)
        stuck, pump.stuck = sorted(pump.stuck), set()
        evidence: dict[str, Any] = {"steady_samples": len(run.time_s)}
        if run.missing:
            evidence["missing"] = sorted(run.missing)
        if not len(run.segments):
            return self._unjudged(run, time_ns, evidence)
        wrong = self._wrong_meters(run.pump, stuck, log_ratio)
        if wrong:
            return self._blame_meter(run, time_ns, evidence | wrong)
        if pump.known is None:
            self._learn(run, log_ratio, time_ns)
        rng = np.random.default_rng(abs(run.window_ns[0]) + run.pump)
        evidence |= run_evidence(run, self._nominal, rng)
        if pump.known is None:
            pump.state = "learning"
            evidence["reason"] = pump.learning.reason if pump.learning is not None else ""
            return self._verdict(run.pump, time_ns, run.window_ns, {"learning": 1.0}, evidence)
        weighed = self._weigh(run, pump.known, log_ratio, evidence)
        remember(weighed.probability, pump.belief, self._system)
        state, remark = decide(weighed, float(np.median(run.head_m)))
        pump.recent.append((sum(run.window_ns) // 2, weighed.shift_m))
        wrong = self._doubtful_meters(run, pump.known, stuck)
        evidence |= wrong
        if wrong and state not in FAULTS:
            state, remark = "sensor_fault", _in_words(wrong)
        pump.take_state(state, run.window_ns, _component(state))
        evidence["index"] = pump.limits.figures(run.segments, pump.known.baseline, rng)
        if state == "normal":
            pump.known = replace(pump.known, baseline=_with_noise(pump.known.baseline, run, self._nominal))
            pump.limits.add(run.segments, pump.known.baseline)
        probability = _named(weighed)
        if state == "sensor_fault" and wrong:
            probability |= {"normal": 0.0, "sensor_fault": probability["normal"] + probability["sensor_fault"]}
        evidence |= self._consequences(run, weighed, probability, state, remark)
        return self._verdict(run.pump, time_ns, run.window_ns, probability, evidence)

    def _unjudged(self, run: Run, time_ns: int, evidence: dict[str, Any]) -> Verdict:
        """Verdict on a run without a segment."""
        pump = self._pumps[run.pump]
        lacking = sorted(run.missing & NEEDED)
        if lacking and pump.known is not None:
            return self._blame_meter(run, time_ns, evidence | {"lost": lacking})
        evidence["reason"] = _blind(lacking) if lacking else f"fewer than {run.segments.samples} steady samples"
        if lacking or pump.known is not None:
            pump.take_state("unknown", run.window_ns, None)
        if lacking:
            evidence |= pump.blind.evidence()
        return self._verdict(run.pump, time_ns, run.window_ns, {pump.state: 1.0}, evidence)

    def _wrong_meters(self, index: int, stuck: list[str], log_ratio: float) -> dict[str, list[str]]:
        """Meters of a run that say nothing of the pump: stuck, or dead while the wet well draws down."""
        known = self._pumps[index].known
        if any(name.endswith(("flow_m3h", "head_m")) for name in stuck):
            return {"stuck": stuck}
        if known is not None and log_ratio - known.drawdown.mean < DEAD_LOG_RATIO:
            return {"dead": [f"pump{index + 1}_flow_m3h"]}
        return {}

    @staticmethod
    def _doubtful_meters(run: Run, known: Knowledge, stuck: list[str]) -> dict[str, list[str]]:
        """Meters that are wrong, while the run can be judged all the same."""
        is_level_lost = "level_m" in run.missing and math.isfinite(known.baseline.level_m)
        wrong = {
            "noisy": sorted(noisy_meters(run, known.noise)),
            "stuck": stuck,
            "lost": ["level_m"] if is_level_lost else [],
        }
        return {how: names for how, names in wrong.items() if names}

    def _blame_meter(self, run: Run, time_ns: int, evidence: dict[str, Any]) -> Verdict:
        """Verdict on a run whose meter is wrong without doubt."""
        self._pumps[run.pump].take_state("sensor_fault", run.window_ns, None)
        evidence["advice"] = advice("sensor_fault", _in_words(evidence))
        return self._verdict(run.pump, time_ns, run.window_ns, {"sensor_fault": 1.0}, evidence)

    def _look_early(self, index: int, time_ns: int) -> list[Verdict]:
        """Verdict on a run that goes on, when two looks in a row are sure of a fault not told yet."""
        pump = self._pumps[index]
        filled = self._runs.full_segments(index)
        if pump.known is None or not filled:
            return []
        baseline = pump.known.baseline
        last = self._runs.last_segments(index, 1)
        deviation_m = np.sqrt(np.diag(baseline.noise(last.segments) + baseline.run_covariance))
        since = pump.cusum.update(baseline.shifts(last.segments)[0], deviation_m)
        if since < EARLY_SEGMENTS or pump.stuck:
            pump.early = None
            return []
        run = self._runs.last_segments(index, min(since, filled))
        is_dry = np.median(run.total_flow_m3h) < NO_FLOW_SHARE * self._nominal.runout_flow_m3h(index)
        if is_dry and math.isfinite(pump.known.drawdown.mean):
            return []  # the drawdown will tell at the end of the run whether the flow meter is dead
        evidence: dict[str, Any] = {"steady_samples": len(run.time_s), "early": True}
        weighed = self._weigh(run, pump.known, math.nan, evidence)
        state, remark = decide(weighed, float(np.median(run.head_m)))
        is_sure = state in FAULTS and weighed.probability[[PUMP_FAULT, SYSTEM_FAULT, BOTH]].sum() > EARLY_PROBABILITY
        previous, pump.early = pump.early, state if is_sure else None
        if pump.early is None or pump.early != previous or state == pump.state:
            return []
        rng = np.random.default_rng(abs(run.window_ns[0]) + run.pump)
        pump.recent.append((sum(run.window_ns) // 2, weighed.shift_m))
        pump.take_state(state, run.window_ns, _component(state))
        pump.recent.pop()
        evidence |= run_evidence(run, self._nominal, rng)
        evidence["index"] = pump.limits.figures(run.segments, baseline, rng)
        evidence |= self._consequences(run, weighed, _named(weighed), state, remark)
        return [self._verdict(index, time_ns, run.window_ns, _named(weighed), evidence)]

    def _learn(self, run: Run, log_ratio: float, time_ns: int) -> None:
        pump = self._pumps[run.pump]
        curve = self._nominal.curves[run.pump]
        baseline = pump.learn(run, log_ratio, self._seen_s, curve, self._nominal.friction_h2_m5)
        if baseline is None or pump.learning is None:
            return
        offsets_m = [_pump_offset_m(other) for other in self._pumps]
        doubt = sibling_objection(run.pump, offsets_m, self._nominal.curves)
        if doubt is None:
            pump.settle(baseline, time_ns, self._seen_s)
        else:
            pump.learning.reason = doubt

    def _weigh(self, run: Run, known: Knowledge, log_ratio: float, evidence: dict[str, Any]) -> Weighed:
        observation = observe(
            run,
            known.baseline,
            self._nominal.curves[run.pump],
            self._nominal.friction_h2_m5,
            drawdown=(log_ratio, known.drawdown),
            power=known.power,
        )
        evidence |= shift_evidence(observation)
        evidence["baseline"] = known.version
        scales = fault_scales(self._nominal, run.pump, known.baseline)
        return weigh(observation, scales, joint_prior(self._pumps[run.pump].belief, self._system))

    def _consequences(
        self, run: Run, weighed: Weighed, probability: Mapping[State, float], state: State, remark: str | None
    ) -> dict[str, Any]:
        """Severity, advice and expected costs."""
        known, segments = self._pumps[run.pump].known, run.segments
        flow_m3h = float(np.median(segments.flow_m3h))
        friction_m = self._nominal.friction_h2_m5 * float(np.median(segments.total_m3h)) ** 2
        healthy_m3h = known.baseline.explained_flows(segments)[0] if known is not None else flow_m3h
        power_kw = float(np.nanmean(run.power_kw)) if np.isfinite(run.power_kw).any() else 0.0
        run_share = self._pumps[run.pump].run_s / max(self._seen_s, 1.0)
        wasted_kwh = power_kw * 24.0 * run_share * max(1.0 - flow_m3h / max(healthy_m3h, 1e-9), 0.0)
        curve = self._nominal.curves[run.pump]
        figures: dict[str, Any] = {
            "severity": severity(weighed.shift_m, weighed.deviation_m, curve, flow_m3h, friction_m),
            "advice": advice(state, remark),
            "cost": expected_costs(probability, wasted_kwh, self._costs),
        }
        return figures

    def _verdict(
        self,
        index: int,
        time_ns: int,
        window_ns: tuple[int, int],
        probability: dict[State, float],
        evidence: dict[str, Any],
    ) -> Verdict:
        pump = self._pumps[index]
        rolling = pump.rolling.value()
        if rolling is not None:
            evidence["rolling_f_test"] = {
                "pump": f_test_figures(rolling.pump),
                "system": f_test_figures(rolling.system),
            }
        return Verdict(
            time=time_ns,
            station=self._station,
            pump=index + 1,
            state=pump.state,
            probability=probability,
            evidence=evidence,
            onset=pump.onset_ns if pump.state in FAULTS else None,
            window=window_ns,
        )


def _blind(lacking: list[str]) -> str:
    return f"without {', '.join(lacking)} pump and system cannot be told apart"


def _with_noise(baseline: Baseline, run: Run, nominal: Nominal) -> Baseline:
    return baseline.with_noise_of(run.segments, NOISE_WEIGHT, nominal.curves[run.pump][0])


def _pump_offset_m(pump: PumpRecord) -> float | None:
    """r_p of a pump, learnt or being learnt. [m]."""
    if pump.known is not None:
        return float(pump.known.baseline.offset_m[0])
    return pump.learning.offset_m if pump.learning is not None else None


def _in_words(wrong: Mapping[str, Any]) -> str:
    return ", ".join(f"{' and '.join(wrong[how])} {how}" for how in WRONG if how in wrong)


def _component(state: State) -> int | None:
    """Component of the shift in which the onset of a fault shows; None without a fault."""
    return {"pump_fault": PUMP, "system_fault": SYSTEM, "pump_and_system_fault": PUMP}.get(state)


def _named(weighed: Weighed) -> dict[State, float]:
    p = weighed.probability
    return {
        "normal": float(p[NORMAL]),
        "pump_fault": float(p[PUMP_FAULT]),
        "system_fault": float(p[SYSTEM_FAULT]),
        "pump_and_system_fault": float(p[BOTH]),
        "sensor_fault": float(p[FLOW_METER] + p[HEAD_SENSOR]),
    }
