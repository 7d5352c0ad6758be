"""The detector of one station: samples in, verdicts out; the same for a live stream and for a recording."""

import math
from typing import Any

import numpy as np

from wetwell.detector.baseline import Baseline, sibling_objection
from wetwell.detector.curve_drift import RollingFTest
from wetwell.detector.evidence import f_test_figures, run_evidence
from wetwell.detector.gate import Gate
from wetwell.detector.index_limits import IndexLimits
from wetwell.detector.learning import Learning
from wetwell.detector.nominal import Nominal
from wetwell.detector.posterior import (
    FAULTS,
    PRIOR,
    STATES,
    Floats,
    posterior,
    prior_of_next_run,
    shift_of,
    shift_scales_m,
)
from wetwell.detector.runs import NEEDED, SEGMENT_SAMPLES, Run, RunTracker
from wetwell.protocols.messages import Sample, State, Verdict
from wetwell.protocols.stamps import NS_PER_S

ALARM_PROBABILITY = 0.99
EARLY_PROBABILITY = 0.999
EARLY_SEGMENTS = 3
NOISE_WEIGHT = 0.05
ROLLING_SAMPLES = 300


class _Pump:
    """What the detector knows of one pump."""

    def __init__(self) -> None:
        self.learning = Learning()
        self.baseline: Baseline | None = None
        self.prior: Floats = PRIOR
        self.state: State = "learning"
        self.onset_ns: int | None = None
        self.early: State | None = None
        self.rolling = RollingFTest(ROLLING_SAMPLES)
        self.limits = IndexLimits()


class Detector:
    """Judges the pumps of one station.

    Gate, pump runs, learning, and for each run the probability of {normal, pump, system, both} from how far the level
    residuals lie from the learnt baseline. A verdict comes at the end of each run, when a state changes, and once for
    each pump when the first sample comes. Without flow, head and frequency no state can be told: the verdict is
    `unknown` and names what is missing.

    Memory: the steady samples of the learning phase, then of one run. Warm-up: six hours of station time.

    Parameters
    ----------
    station : str
        Name for the verdicts.
    nominal : Nominal
        Datasheet curves.
    """

    def __init__(self, station: str, nominal: Nominal) -> None:
        self._station = station
        self._nominal = nominal
        self._gate = Gate(nominal)
        self._runs = RunTracker(nominal)
        self._pumps = [_Pump() for _ in range(nominal.pumps)]
        self._rng = np.random.default_rng(0)
        self._seen_s = 0.0
        self._is_new = True

    @property
    def counts(self) -> dict[str, int]:
        """How many samples and values the gate has let through, marked or dropped."""
        return dict(self._gate.counts)

    def update(self, sample: Sample) -> tuple[Verdict, ...]:
        """Verdicts that a sample brings."""
        frame = self._gate.update(sample)
        if frame is None:
            return ()
        verdicts: list[Verdict] = []
        if self._is_new:
            self._is_new = False
            verdicts += [self._first_verdict(index, frame.time_ns) for index in range(len(self._pumps))]
        if math.isfinite(frame.gap_s):
            self._seen_s += frame.gap_s
        ended = self._runs.update(frame)
        verdicts += [self._judge(run, frame.time_ns) for run in ended + self._runs.newly_blind_runs()]
        for index, *steady in self._runs.steady_samples():
            self._pumps[index].rolling.update(frame.time_ns / NS_PER_S, *steady)
            verdicts += self._look_early(index, frame.time_ns)
        return tuple(verdicts)

    def finish(self) -> tuple[Verdict, ...]:
        """Verdicts on the runs that are still open at the end of a recording."""
        return tuple(self._judge(run, run.window_ns[1]) for run in self._runs.finish())

    def _first_verdict(self, index: int, time_ns: int) -> Verdict:
        return self._verdict(index, time_ns, (time_ns, time_ns), {"learning": 1.0}, {"reason": "begins"})

    def _judge(self, run: Run, time_ns: int) -> Verdict:
        """Verdict on a run that has ended."""
        pump = self._pumps[run.pump]
        pump.early = None
        evidence: dict[str, Any] = {"steady_samples": len(run.time_s)}
        if run.missing:
            evidence["missing"] = sorted(run.missing)
        if not len(run.segments):
            lacking = run.missing & NEEDED
            evidence["reason"] = (
                f"without {', '.join(sorted(lacking))} pump and system cannot be told apart"
                if lacking
                else f"fewer than {SEGMENT_SAMPLES} steady samples near nominal frequency"
            )
            if lacking or pump.baseline is not None:
                pump.state = "unknown"
            return self._verdict(run.pump, time_ns, run.window_ns, {pump.state: 1.0}, evidence)
        if pump.baseline is None:
            self._learn(run)
        evidence |= run_evidence(run, self._nominal, self._rng)
        if pump.baseline is None:
            pump.state = "learning"
            evidence["reason"] = pump.learning.reason
            return self._verdict(run.pump, time_ns, run.window_ns, {"learning": 1.0}, evidence)
        probability = self._weigh(run, pump.baseline, evidence)
        pump.prior = prior_of_next_run(probability)
        self._take_state(run, _decide(probability))
        evidence["index"] = pump.limits.figures(run, pump.baseline, self._rng)
        if pump.state == "normal":
            pump.baseline = pump.baseline.with_noise_of(run, NOISE_WEIGHT)
            pump.limits.add(run, pump.baseline)
        return self._verdict(run.pump, time_ns, run.window_ns, _named(probability), evidence)

    def _look_early(self, index: int, time_ns: int) -> list[Verdict]:
        """Verdict on the end of a run that goes on, when two looks in a row are sure of a fault not told yet."""
        pump = self._pumps[index]
        run = self._runs.last_segments(index, EARLY_SEGMENTS) if pump.baseline is not None else None
        if pump.baseline is None or run is None:
            return []
        evidence: dict[str, Any] = {"steady_samples": len(run.time_s), "early": True}
        probability = self._weigh(run, pump.baseline, evidence)
        state = _decide(probability)
        is_sure = state in FAULTS and 1.0 - probability[0] > EARLY_PROBABILITY
        previous, pump.early = pump.early, state if is_sure else None
        if pump.early is None or pump.early != previous or state == pump.state:
            return []
        self._take_state(run, state)
        evidence |= run_evidence(run, self._nominal, self._rng)
        evidence["index"] = pump.limits.figures(run, pump.baseline, self._rng)
        return [self._verdict(index, time_ns, run.window_ns, _named(probability), evidence)]

    def _learn(self, run: Run) -> None:
        pump = self._pumps[run.pump]
        pump.learning.add(run, self._seen_s)
        baseline = pump.learning.baseline(self._seen_s, self._nominal.curves[run.pump][0])
        if baseline is None:
            return
        offsets_m = [
            float(other.baseline.offset_m[0]) if other.baseline is not None else other.learning.offset_m
            for other in self._pumps
        ]
        doubt = sibling_objection(run.pump, offsets_m, self._nominal.curves)
        if doubt is None:
            pump.baseline = baseline
            for learnt in pump.learning.runs:
                pump.limits.add(learnt, baseline)
            pump.learning = Learning()
        else:
            pump.learning.reason = doubt

    def _weigh(self, run: Run, baseline: Baseline, evidence: dict[str, Any]) -> Floats:
        curve = self._nominal.curves[run.pump]
        shift = shift_of(run, baseline, curve, self._nominal.friction_h2_m5)
        scales_m = shift_scales_m(self._nominal, run.pump, baseline)
        evidence["shift_m"] = {"pump": _rounded(shift.mean_m[0]), "system": _rounded(shift.mean_m[1])}
        evidence["shift_sigmas"] = {"pump": _rounded(shift.sigmas[0]), "system": _rounded(shift.sigmas[1])}
        return posterior(shift, scales_m, self._pumps[run.pump].prior)

    def _take_state(self, run: Run, state: State) -> None:
        pump = self._pumps[run.pump]
        if state not in FAULTS:
            pump.onset_ns = None
        elif pump.onset_ns is None:
            pump.onset_ns = run.window_ns[0]
        pump.state = state

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


def _decide(probability: Floats) -> State:
    """State to tell: a fault above `ALARM_PROBABILITY`, normal above one half, else unknown."""
    if 1.0 - probability[0] > ALARM_PROBABILITY:
        return STATES[1 + int(np.argmax(probability[1:]))]
    return "normal" if probability[0] > 0.5 else "unknown"


def _named(probability: Floats) -> dict[State, float]:
    return {state: float(share) for state, share in zip(STATES, probability, strict=True)}


def _rounded(value: float) -> float:
    return round(float(value), 4) if math.isfinite(value) else value
