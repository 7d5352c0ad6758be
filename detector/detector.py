"""The detector of one station: samples in, verdicts out; the same for a live stream and for a recording."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from wetwell.detector.baseline.learning import sibling_objection
from wetwell.detector.baseline.model import Baseline
from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.inference.decision import decide, onset_component
from wetwell.detector.inference.observation import observe
from wetwell.detector.inference.posterior import (
    BOTH,
    FAULTS,
    PUMP_FAULT,
    SYSTEM_FAULT,
    Weighed,
    fault_scales,
    weigh,
)
from wetwell.detector.inference.prior import SystemBelief, joint_prior, remember
from wetwell.detector.pump_judge import ROLLING_SAMPLES, Knowledge, PumpRecord
from wetwell.detector.runs.run import NEEDED, Run
from wetwell.detector.runs.run_tracker import RunTracker
from wetwell.detector.sensors.sensor_faults import doubtful_meters, in_words, silencing_meters
from wetwell.detector.snapshot.codec import decode_snapshot, encode_snapshot
from wetwell.detector.statistics.robust import median
from wetwell.detector.statistics.rolling_f_test import RollingFTest
from wetwell.detector.stream.block import Block, LiveBlock
from wetwell.detector.stream.drawdown import new_phases
from wetwell.detector.stream.gate import Gate
from wetwell.detector.stream.loop import BEGIN, DONE, ENDED, FULL, GATHERED, GOES_ON, LOOK, advance
from wetwell.detector.stream.missing_signals import new_blinds
from wetwell.detector.stream.run_state import NO_FLOW_SHARE
from wetwell.detector.stream.stuck_sensors import new_meters, stuck_names
from wetwell.detector.verdict.evidence import f_test_figures, run_evidence, shift_evidence
from wetwell.detector.verdict.maintenance import Costs, advice, expected_costs
from wetwell.detector.verdict.severity import severity
from wetwell.protocols.messages.messages import State, Verdict
from wetwell.protocols.messages.readings import Readings
from wetwell.protocols.quantities import FIRST_PUMP, FLOW, FREQUENCY, HEAD, PUMP_VALUES

EARLY_PROBABILITY = 0.999
EARLY_SEGMENTS = 2
NOISE_WEIGHT = 0.05
_ARRAYS = ("gate", "pumps", "pace", "rows", "phases", "meters", "blinds", "windows", "moments", "counts")


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
    datasheet : Datasheet
        Datasheet curves.
    costs : Costs, optional
        For the expected cost of each act.
    """

    def __init__(self, station: str, datasheet: Datasheet, costs: Costs | None = None) -> None:
        self._station = station
        self._datasheet = datasheet
        self._costs = costs or Costs()
        self._gate = Gate(datasheet)
        self._runs = RunTracker(datasheet)
        self._phases = new_phases()
        self._meters = new_meters(datasheet.pumps)
        self._blinds = new_blinds(datasheet.pumps)
        self._rolling = RollingFTest(ROLLING_SAMPLES, datasheet.pumps)
        self._live = LiveBlock(datasheet.pumps)
        self._system = SystemBelief()
        self._pumps = [PumpRecord() for _ in range(datasheet.pumps)]

    @property
    def counts(self) -> dict[str, int]:
        """How many samples and values the gate has let through, marked or dropped."""
        return dict(self._gate.counts)

    @property
    def seen_until_ns(self) -> int:
        """Time of the last sample that was let through; 0 before the first."""
        return int(self._gate.state["time_ns"][0])

    @property
    def last_heard(self) -> tuple[int, int]:
        """Time and number of the last sample that came, let through or not, as long as numbers count up."""
        state = self._gate.state[0]
        return int(state["other_ns"] if state["other_count"] else state["time_ns"]), int(state["seq"])

    @property
    def baselines(self) -> tuple[Baseline | None, ...]:
        """What was learnt of each pump; None while it is being learnt."""
        return tuple(None if pump.known is None else pump.known.baseline for pump in self._pumps)

    def update(self, sample: Readings) -> tuple[Verdict, ...]:
        """Verdicts that a sample brings."""
        return tuple(self.take(self._live.fill(sample)))

    def take(self, block: Block) -> list[Verdict]:
        """Verdicts that a block of samples brings; the same as if they came one by one."""
        return list(self.verdicts_on(block))

    def verdicts_on(self, block: Block) -> Iterator[Verdict]:
        """Yield the verdicts that a block of samples brings, each as soon as it is there; take them all."""
        if not self._gate.state["is_begun"][0] and len(block.time_ns):
            begin_ns = int(block.time_ns[0])
            yield from [self._told(pump, begin_ns, (begin_ns, begin_ns), "begins") for pump in self._every()]
        row, stop = advance(0, BEGIN, *block, *self._arrays())
        while stop != DONE:
            yield from self._stopped(stop)
            row, stop = advance(row, GOES_ON[stop], *block, *self._arrays())

    def _stopped(self, stop: int) -> list[Verdict]:
        """Verdicts where the loop over the samples has stopped."""
        now_ns = int(self._gate.state["time_ns"][0])
        if stop == FULL:
            self._runs.make_room()
            return []
        if stop == GATHERED:
            full = np.flatnonzero(self._blinds["is_full"]).tolist()
            changed = [pump for pump in full if self._pumps[pump].blind.take(self._blinds[pump])]
            return [self._tell_blind(pump, now_ns) for pump in changed]
        if stop == LOOK:
            return [verdict for pump in self._runs.full_pumps() for verdict in self._look_early(pump, now_ns)]
        runs = self._runs.take_ended(now_ns) if stop == ENDED else self._runs.newly_blind_runs()
        return [self._judge(run, max(now_ns, run.window_ns[1])) for run in runs]  # the clock may have been set back

    def _arrays(self) -> tuple[Any, ...]:
        """The state that the loop over the samples changes."""
        gate, runs, rolling = self._gate, self._runs, self._rolling
        return (
            *(runs.table, gate.state, gate.ranges, gate.frame, runs.pumps, runs.pace, runs.rows),
            *(self._phases, self._datasheet.area_m2, self._meters, self._blinds),
            *(rolling.windows, rolling.moments, rolling.counts),
        )

    def finish(self) -> tuple[Verdict, ...]:
        """Verdicts on the runs that are still open at the end of a recording."""
        open_runs = [run for run in self._runs.finish() if len(run.segments) or run.missing & NEEDED]
        return tuple(self._judge(run, run.window_ns[1]) for run in open_runs)

    def snapshot(self) -> bytes:
        """The whole state, from which `restore` goes on bit for bit."""
        arrays = dict(zip(_ARRAYS, self._stateful_arrays(), strict=True))
        state = {"arrays": arrays, "system": self._system, "pumps": self._pumps}
        return encode_snapshot(self._station, self._datasheet, state)

    def restore(self, data: bytes) -> None:
        """Go on from a snapshot of the same station.

        Raises
        ------
        SnapshotError
            If it is damaged, of another format or station; this detector is left as it was.
        """
        state = decode_snapshot(data, self._station, self._datasheet)
        blank = Detector(self._station, self._datasheet)
        arrays = dict(zip(_ARRAYS, blank._stateful_arrays(), strict=True)) | state["arrays"]
        self._runs.rows = np.empty_like(arrays["rows"])
        for name, array in zip(_ARRAYS, self._stateful_arrays(), strict=True):
            array[...] = arrays[name]
        self._system, self._pumps = state["system"], state["pumps"]

    def _stateful_arrays(self) -> tuple[npt.NDArray[Any], ...]:
        gate, runs, rolling = self._gate, self._runs, self._rolling
        return (
            *(gate.state, runs.pumps, runs.pace, runs.rows, self._phases, self._meters, self._blinds),
            *(rolling.windows, rolling.moments, rolling.counts),
        )

    def rebaseline(self, pump: int, now_ns: int) -> Verdict:
        """Learn a pump (from 0) anew; what was learnt before is put aside and can be taken back."""
        self._pumps[pump].rebaseline(self._seen_s)
        self._begin_anew(pump)
        self._system = SystemBelief()
        return self._told(pump, now_ns, (now_ns, now_ns), "re-baselined by an operator")

    def revert(self, pump: int, now_ns: int) -> Verdict:
        """Take the baseline of a pump (from 0) back that was put aside last; without one nothing changes."""
        is_back = self._pumps[pump].revert()
        if is_back:
            self._begin_anew(pump)
        reason = "baseline taken back by an operator" if is_back else "no baseline was put aside"
        return self._told(pump, now_ns, (now_ns, now_ns), reason)

    @property
    def _seen_s(self) -> float:
        """Time that the station has been seen."""
        return float(self._gate.state["seen_s"][0])

    def _begin_anew(self, pump: int) -> None:
        """Forget what the open run has shown under another baseline."""
        self._runs.pumps["stuck"][pump] = 0
        self._blinds[pump] = new_blinds(1)[0]
        self._runs.pumps["is_learning"][pump] = self._pumps[pump].known is None

    def _every(self) -> range:
        return range(len(self._pumps))

    def _told(self, index: int, time_ns: int, window_ns: tuple[int, int], reason: str) -> Verdict:
        pump = self._pumps[index]
        evidence: dict[str, Any] = {"reason": reason}
        if pump.known is not None:
            evidence["baseline"] = pump.known.version
        return self._verdict(index, time_ns, window_ns, {pump.state: 1.0}, evidence)

    def _tell_blind(self, index: int, time_ns: int) -> Verdict:
        """Verdict on a pump that cannot be judged, when it begins or ceases to run as it used to."""
        pump, now = self._pumps[index], (time_ns, time_ns)
        reading = self._gate.frame[FIRST_PUMP + PUMP_VALUES * index :]
        needed = {"flow_m3h": FLOW, "frequency_hz": FREQUENCY, "head_m": HEAD}
        lacking = [name for name, at in needed.items() if math.isnan(reading[at])]
        pump.take_state("unknown", now, None)
        evidence = {"early": True, "missing": lacking, "reason": _blind(lacking)}
        evidence |= pump.blind.evidence(int(self._blinds["running"][index]))
        return self._verdict(index, time_ns, now, {"unknown": 1.0}, evidence)

    def _judge(self, run: Run, time_ns: int) -> Verdict:
        """Verdict on a run that has ended."""
        pump = self._pumps[run.pump]
        pump.early = None
        pump.cusum.reset()
        running = self._runs.pumps[run.pump]
        log_ratio, running["log_ratio"] = float(running["log_ratio"]), math.nan
        stuck, running["stuck"] = stuck_names(run.pump, int(running["stuck"])), 0
        evidence: dict[str, Any] = {"steady_samples": len(run.time_s)}
        if run.missing:
            evidence["missing"] = sorted(run.missing)
        if not len(run.segments):
            return self._unjudged(run, time_ns, evidence)
        wrong = silencing_meters(run.pump, pump.known, stuck, log_ratio)
        if wrong:
            return self._blame_meter(run, time_ns, evidence | wrong)
        if pump.known is None:
            self._learn(run, log_ratio, time_ns)
        rng = np.random.default_rng(abs(run.window_ns[0]) + run.pump)
        evidence |= run_evidence(run, self._datasheet, rng)
        if pump.known is None:
            pump.state = "learning"
            evidence["reason"] = pump.learning.reason if pump.learning is not None else ""
            return self._verdict(run.pump, time_ns, run.window_ns, {"learning": 1.0}, evidence)
        weighed = self._weigh(run, pump.known, log_ratio, evidence)
        remember(weighed.probability, pump.belief, self._system)
        state, remark = decide(weighed, float(median(run.head_m)))
        pump.recent.append((sum(run.window_ns) // 2, weighed.shift_m))
        wrong = doubtful_meters(run, pump.known, stuck)
        evidence |= wrong
        if wrong and state not in FAULTS:
            state, remark = "sensor_fault", in_words(wrong)
        pump.take_state(state, run.window_ns, onset_component(state))
        evidence["index"] = pump.limits.figures(run.segments, pump.known.baseline, rng)
        if state == "normal":
            pump.known = replace(pump.known, baseline=_with_noise(pump.known.baseline, run, self._datasheet))
            pump.limits.add(run.segments, pump.known.baseline)
        probability = weighed.by_state()
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
            evidence |= pump.blind.evidence(int(self._blinds["running"][run.pump]))
        return self._verdict(run.pump, time_ns, run.window_ns, {pump.state: 1.0}, evidence)

    def _blame_meter(self, run: Run, time_ns: int, evidence: dict[str, Any]) -> Verdict:
        """Verdict on a run whose meter is wrong without doubt."""
        self._pumps[run.pump].take_state("sensor_fault", run.window_ns, None)
        evidence["advice"] = advice("sensor_fault", in_words(evidence))
        return self._verdict(run.pump, time_ns, run.window_ns, {"sensor_fault": 1.0}, evidence)

    def _look_early(self, index: int, time_ns: int) -> list[Verdict]:
        """Verdict on a run that goes on, when two looks in a row are sure of a fault not told yet."""
        pump = self._pumps[index]
        filled = self._runs.full_segments(index)
        if pump.known is None or not filled:
            return []
        baseline = pump.known.baseline
        last = self._runs.last_segment(index)
        deviation_m = np.sqrt(baseline.noise(last).diagonal() + baseline.run_covariance.diagonal())
        since = pump.cusum.update(baseline.shifts(last)[0], deviation_m)
        if since < EARLY_SEGMENTS or self._runs.pumps["stuck"][index]:
            pump.early = None
            return []
        run = self._runs.last_segments(index, min(since, filled))
        is_dry = median(run.total_flow_m3h) < NO_FLOW_SHARE * self._datasheet.runout_flow_m3h(index)
        if is_dry and math.isfinite(pump.known.drawdown.mean):
            return []  # the drawdown will tell at the end of the run whether the flow meter is dead
        evidence: dict[str, Any] = {"steady_samples": len(run.time_s), "early": True}
        weighed = self._weigh(run, pump.known, math.nan, evidence)
        state, remark = decide(weighed, float(median(run.head_m)))
        is_sure = state in FAULTS and weighed.probability[[PUMP_FAULT, SYSTEM_FAULT, BOTH]].sum() > EARLY_PROBABILITY
        previous, pump.early = pump.early, state if is_sure else None
        if pump.early is None or pump.early != previous or state == pump.state:
            return []
        rng = np.random.default_rng(abs(run.window_ns[0]) + run.pump)
        pump.recent.append((sum(run.window_ns) // 2, weighed.shift_m))
        pump.take_state(state, run.window_ns, onset_component(state))
        pump.recent.pop()
        evidence |= run_evidence(run, self._datasheet, rng)
        evidence["index"] = pump.limits.figures(run.segments, baseline, rng)
        evidence |= self._consequences(run, weighed, weighed.by_state(), state, remark)
        return [self._verdict(index, time_ns, run.window_ns, weighed.by_state(), evidence)]

    def _learn(self, run: Run, log_ratio: float, time_ns: int) -> None:
        pump = self._pumps[run.pump]
        curve = self._datasheet.curves[run.pump]
        baseline = pump.learn(run, log_ratio, self._seen_s, curve, self._datasheet.friction_h2_m5)
        if baseline is None or pump.learning is None:
            return
        offsets_m = [other.offset_m for other in self._pumps]
        doubt = sibling_objection(run.pump, offsets_m, self._datasheet.curves)
        if doubt is None:
            pump.settle(baseline, time_ns, self._seen_s)
            self._runs.pumps["is_learning"][run.pump] = 0
        else:
            pump.learning.reason = doubt

    def _weigh(self, run: Run, known: Knowledge, log_ratio: float, evidence: dict[str, Any]) -> Weighed:
        observation = observe(
            run,
            known.baseline,
            self._datasheet.curves[run.pump],
            self._datasheet.friction_h2_m5,
            drawdown=(log_ratio, known.drawdown),
            power=known.power,
        )
        evidence |= shift_evidence(observation)
        evidence["baseline"] = known.version
        scales = fault_scales(self._datasheet, run.pump, known.baseline)
        return weigh(observation, scales, joint_prior(self._pumps[run.pump].belief, self._system))

    def _consequences(
        self, run: Run, weighed: Weighed, probability: Mapping[State, float], state: State, remark: str | None
    ) -> dict[str, Any]:
        """Severity, advice and expected costs."""
        known, segments = self._pumps[run.pump].known, run.segments
        flow_m3h = float(median(segments.flow_m3h))
        friction_m = self._datasheet.friction_h2_m5 * float(median(segments.total_m3h)) ** 2
        healthy_m3h = known.baseline.explained_flows(segments)[0] if known is not None else flow_m3h
        power_kw = float(np.nanmean(run.power_kw)) if np.isfinite(run.power_kw).any() else 0.0
        run_share = float(self._runs.pumps["run_s"][run.pump]) / max(self._seen_s, 1.0)
        wasted_kwh = power_kw * 24.0 * run_share * max(1.0 - flow_m3h / max(healthy_m3h, 1e-9), 0.0)
        curve = self._datasheet.curves[run.pump]
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
        running, rolling = self._runs.pumps[index], self._rolling.value(index)
        if rolling is not None:
            evidence["rolling_f_test"] = {
                "pump": f_test_figures(rolling.pump),
                "system": f_test_figures(rolling.system),
                "strongest_log_p": {"pump": float(running["pump_log_p"]), "system": float(running["system_log_p"])},
            }
            running["pump_log_p"] = running["system_log_p"] = 0.0
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


def _with_noise(baseline: Baseline, run: Run, datasheet: Datasheet) -> Baseline:
    return baseline.with_noise_of(run.segments, NOISE_WEIGHT, datasheet.curves[run.pump][0])
