"""The detector of a station: its verdicts, whatever way the samples come."""

import math
import pickle
from itertools import pairwise

import numpy as np
import pytest

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.inference.posterior import FAULT_STATES
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.timestamps import LEARNING_S, NS_PER_S
from wetwell.simulator.faults.pump.blockage import Blockage
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

HOURS = 9
PUMP_2_BLOCKED = Scenario(
    name="short", fault=(Blockage(pump=2, speed_loss=0.4, start_s=24_000, end_s=30_000, after="hold"),)
)


@pytest.fixture(scope="module")
def samples(alpha):
    recording = Simulation(alpha, PUMP_2_BLOCKED, 3).advance(HOURS * 3600)
    return list(recording.samples(alpha.name))


def judged(station, stream):
    detector = Detector(station.name, datasheet_of(station))
    verdicts = [verdict for sample in stream for verdict in detector.update(sample)]
    return [*verdicts, *detector.finish()], detector


@pytest.fixture(scope="module")
def verdicts(alpha, samples):
    return judged(alpha, samples)[0]


def test_the_first_sample_gives_one_learning_verdict_a_pump(alpha, samples):
    first = Detector(alpha.name, datasheet_of(alpha)).update(samples[0])
    assert [(verdict.pump, verdict.state, verdict.time) for verdict in first] == [
        (pump, "learning", samples[0].time) for pump in (1, 2, 3)
    ]


def test_the_blocked_pump_is_told_and_no_other(verdicts):
    told = {verdict.pump for verdict in verdicts if verdict.state in FAULT_STATES}
    assert told == {2}
    assert [verdict.state for verdict in verdicts if verdict.pump == 2][-1] == "pump_fault"


def test_every_verdict_is_complete_and_survives_the_wire(verdicts):
    for verdict in verdicts:
        assert sum(verdict.probability.values()) == pytest.approx(1.0)
        assert verdict.state in verdict.probability or verdict.state == "unknown"
        assert verdict.window[0] <= verdict.window[1] <= verdict.time
        assert (verdict.onset is not None) is (verdict.state in FAULT_STATES)
        assert Verdict.decode(verdict.encode()) == verdict
        if verdict.state in ("normal", *FAULT_STATES):
            assert {"steady_samples", "shift_m", "shift_sigmas", "f_test", "index"} <= verdict.evidence.keys()


def test_the_strongest_rolling_test_is_that_since_the_verdict_before(verdicts):
    rolling = [verdict.evidence["rolling_f_test"] for verdict in verdicts if "rolling_f_test" in verdict.evidence]
    assert len(rolling) > 20
    for curve in ("pump", "system"):
        assert all(figures["strongest_log_p"][curve] <= figures[curve]["log_p"] for figures in rolling)
        assert any(figures["strongest_log_p"][curve] < figures[curve]["log_p"] - 1.0 for figures in rolling)
        assert len({figures["strongest_log_p"][curve] for figures in rolling}) == len(rolling), "begun anew each time"


def test_the_windows_of_a_pump_follow_one_another(verdicts):
    whole = [verdict for verdict in verdicts[3:] if "early" not in verdict.evidence]
    for pump in (1, 2, 3):
        for before, after in pairwise(verdict.window for verdict in whole if verdict.pump == pump):
            assert before[1] < after[0]


def test_a_fault_is_told_within_the_run_and_its_onset_stays(verdicts):
    faults = [verdict for verdict in verdicts if verdict.state == "pump_fault"]
    whole = next(verdict for verdict in faults if "early" not in verdict.evidence)
    assert [verdict.evidence.get("early") for verdict in faults].count(True) == 1, "told once, not at every look"
    assert faults[0].evidence["early"] is True
    assert faults[0].evidence["steady_samples"] == 75
    begun_s = (faults[0].time - whole.window[0]) / NS_PER_S
    assert 104 <= begun_s <= 160, "two looks, after 50 and 75 steady samples at the soonest"
    (onset,) = {verdict.onset for verdict in faults}
    healthy = [verdict for verdict in verdicts if verdict.pump == 2 and verdict.state == "normal"][-1]
    assert sum(healthy.window) // 2 <= onset <= faults[0].window[0], "no run between these two has been seen"


def test_doubled_and_late_samples_change_no_verdict(alpha, samples, verdicts):
    rng = np.random.default_rng(0)
    mixed = []
    for n, sample in enumerate(samples):
        mixed.append(sample)
        if rng.random() < 0.2:
            mixed.append(sample)
        if rng.random() < 0.2:
            mixed.append(samples[max(n - int(rng.integers(1, 200)), 0)])
    disturbed, detector = judged(alpha, mixed)
    assert disturbed == verdicts
    assert detector.counts["doubled"] > 1000
    assert detector.counts["late"] > 1000
    assert detector.counts.get("clock_steps", 0) == 0


def test_without_head_and_frequency_nothing_is_blamed(alpha, samples):
    blind = [
        sample.model_copy(
            update={
                "pumps": tuple(
                    reading.model_copy(update={"head_m": None, "frequency_hz": None}) for reading in sample.pumps
                )
            }
        )
        for sample in samples
    ]
    told = judged(alpha, blind)[0][3:]
    assert len(told) > 20
    for verdict in told:
        assert verdict.state == "unknown"
        assert verdict.probability == {"unknown": 1.0}
        assert verdict.evidence["missing"] == ["frequency_hz", "head_m"]
        assert "frequency_hz, head_m" in verdict.evidence["reason"]


def test_bursts_of_nan_crash_nothing_and_blame_nobody_else(alpha, samples):
    rng, nothing = np.random.default_rng(1), PumpReading(flow_m3h=math.nan, head_m=math.inf, frequency_hz=-math.inf)
    broken, left = [], 0
    for sample in samples:
        left = int(rng.integers(1, 40)) if left == 0 and rng.random() < 0.01 else max(left - 1, 0)
        broken.append(sample.model_copy(update={"pumps": (nothing,) * 3, "level_m": math.nan}) if left else sample)
    told, detector = judged(alpha, broken)
    assert detector.counts["missing_values"] > 10_000
    assert {verdict.pump for verdict in told if verdict.state in FAULT_STATES} == {2}
    assert all(sum(verdict.probability.values()) == pytest.approx(1.0) for verdict in told)


def test_a_clock_that_jumps_a_day_ahead_does_not_shorten_learning(alpha, samples):
    ahead = [
        sample if n < 3600 else sample.model_copy(update={"time": sample.time + 86_400 * NS_PER_S})
        for n, sample in enumerate(samples[: int(LEARNING_S) - 600])
    ]
    told, detector = judged(alpha, ahead)
    assert detector.counts["clock_steps"] == 1
    assert {verdict.state for verdict in told} == {"learning"}


def test_a_run_too_short_to_judge_is_unknown_and_carries_no_onset(alpha, samples):
    detector = Detector(alpha.name, datasheet_of(alpha))
    for sample in samples:
        detector.update(sample)
    detector.finish()
    last = samples[-1]
    off = tuple(PumpReading(frequency_hz=0.0, flow_m3h=0.0, head_m=0.0, running=False) for _ in range(3))
    on = (off[0], PumpReading(frequency_hz=50.0, flow_m3h=150.0, head_m=14.0, running=True), off[2])
    told = []
    for n in range(1, 61):
        told += detector.update(
            last.model_copy(
                update={"time": last.time + n * NS_PER_S, "seq": last.seq + n, "pumps": on if 10 < n < 50 else off}
            )
        )
    (verdict,) = told
    assert (verdict.pump, verdict.state, verdict.onset) == (2, "unknown", None)
    assert verdict.evidence["reason"] == "fewer than 25 steady samples"


def cheap_days(days, period_s):
    """Runs of 26 minutes by three pumps in turn, one sample each `period_s`."""
    rng = np.random.default_rng(0)
    off = PumpReading(frequency_hz=0.0, flow_m3h=0.0, head_m=0.0, running=False)
    for seq, second in enumerate(range(0, days * 86_400, period_s)):
        run, within_s = divmod(second, 1800)
        flow_m3h, head_m = 200.2 + rng.normal(0.0, 2.0), 26.0 + rng.normal(0.0, 0.3)
        on = PumpReading(frequency_hz=50.0, flow_m3h=flow_m3h, head_m=head_m, running=True)
        pumps = tuple(on if within_s >= 240 and pump == run % 3 else off for pump in range(3))
        level_m = 1.0 + rng.normal(0.0, 0.002)
        yield Sample(station="alpha", seq=seq, time=second * NS_PER_S, level_m=level_m, pumps=pumps)


@pytest.mark.check
def test_the_state_does_not_grow_over_ten_days(alpha):
    detector, sizes, states = Detector(alpha.name, datasheet_of(alpha)), [], set()
    for n, sample in enumerate(cheap_days(10, 30), start=1):
        states |= {verdict.state for verdict in detector.update(sample)}
        if n % (86_400 // 30) == 0:
            sizes.append(len(pickle.dumps(detector)))
    assert states == {"learning", "normal"}
    assert len(sizes) == 10
    assert max(sizes[2:]) < sizes[1] + 10_000, "a run that is kept takes 3 kB, and there are 380 of them"
