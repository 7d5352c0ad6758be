"""The detector of one station: samples in, verdicts out; of a live stream, or of a recording, whose gaps are sure."""

from collections.abc import Iterator
from typing import Self

from wetwell.detector.baseline.model import Baseline
from wetwell.detector.curves.datasheet import Datasheet, datasheet_of
from wetwell.detector.inference.prior import SystemPrior
from wetwell.detector.pump_judge import Judgement, PumpJudge
from wetwell.detector.runs.run import Run
from wetwell.detector.runs.run_tracker import RunTracker
from wetwell.detector.snapshot.codec import decode_snapshot, encode_snapshot
from wetwell.detector.stream.block import Block, LiveBlock, blocks
from wetwell.detector.stream.gate import gate_counts
from wetwell.detector.stream.loop import Stop
from wetwell.detector.verdict.asset_faults import StageRules
from wetwell.detector.verdict.evidence import rolling_evidence
from wetwell.protocols.messages.readings import Readings
from wetwell.protocols.messages.verdict import Severity, Verdict
from wetwell.protocols.quantities import STATION_QUANTITIES, pump_of
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.costs import Costs
from wetwell.protocols.station.station_file import Station


class Detector:
    """Judges the pumps of one station.

    Gate, pump runs, learning, and for each run the probability of {normal, pump, system, both, wrong meter} from how
    far the level residuals lie from the learnt baseline, with the drawdown of the wet well and the power as further
    witnesses where they are measured. A verdict comes at the end of each run, when a state changes, and once for
    each pump when the first sample comes. Without flow or frequency no state can be told: the verdict is
    `unknown` and names what is missing. Without head the main's datasheet says what the pump lifts: that pump or main
    has moved shows in each run, which of them when several pumps of the main have run.

    Memory: the segments of at most a day of learning, then the steady samples of one run. Warm-up: six hours of
    station time.

    Parameters
    ----------
    station : str
        Name for the verdicts.
    datasheet : Datasheet
        Datasheet curves.
    costs : Costs, optional
        For the expected cost of each act, where the station has none of its own.
    rules : StageRules, optional
        Limits and costs of the station.
    """

    def __init__(
        self, station: str, datasheet: Datasheet, costs: Costs | None = None, rules: StageRules | None = None
    ) -> None:
        rules = rules or StageRules()
        self._station = station
        self._datasheet = datasheet
        self._runs = RunTracker(datasheet)
        self._live = LiveBlock(datasheet.pumps)
        self._systems = [SystemPrior() for _ in datasheet.mains]
        costs = rules.costs or costs or Costs()
        self._judges = [PumpJudge(pump, datasheet, costs, rules) for pump in range(datasheet.pumps)]

    @classmethod
    def of(cls, station: Station, costs: Costs | None = None) -> Self:
        """The detector of a station, by its file; `costs` where the file has none."""
        return cls(station.name, datasheet_of(station), costs, StageRules(station.limits, station.costs))

    @property
    def counts(self) -> dict[str, int]:
        """How many samples and values the gate has let through, marked or dropped."""
        return gate_counts(self._runs.state.gate)

    @property
    def seen_until_ns(self) -> int:
        """Time of the last sample that was let through; 0 before the first."""
        return self._runs.now_ns

    @property
    def last_heard(self) -> tuple[int, int]:
        """Time and number of the last sample that came, let through or not, as long as numbers count up."""
        gate = self._runs.state.gate[0]
        return int(gate["other_ns"] if gate["other_count"] else gate["time_ns"]), int(gate["seq"])

    @property
    def baselines(self) -> tuple[Baseline | None, ...]:
        """What was learnt of each pump; None while it is being learnt."""
        references = (judge.memory.reference for judge in self._judges)
        return tuple(None if reference is None else reference.baseline for reference in references)

    def update(self, sample: Readings) -> tuple[Verdict, ...]:
        """Verdicts that a sample brings."""
        return tuple(self._verdicts_on(self._live.fill(sample)))

    def update_block(self, block: Block) -> list[Verdict]:
        """Verdicts that a block of samples brings; the same as if they came one by one, where none is confirmed."""
        return list(self.verdicts_on(block))

    def verdicts_on(self, block: Block) -> Iterator[Verdict]:
        """Yield the verdicts that a block of samples brings, each as soon as it is there; take them all."""
        return self._verdicts_on(block.in_one_piece())

    def _verdicts_on(self, block: Block) -> Iterator[Verdict]:
        if not self._runs.state.gate["is_begun"][0] and len(block.time_ns):
            begin_ns = int(block.time_ns[0])
            yield from [self._told(pump, begin_ns, "begins") for pump in range(len(self._judges))]
        for stop in self._runs.stops(block):
            yield from self._judged(stop)

    def judge(self, recording: Recording) -> list[Verdict]:
        """Verdicts on a whole recording, and on the runs that are still open at its end."""
        pumps = len(self._judges)
        verdicts = [verdict for block in blocks(recording, pumps) for verdict in self.update_block(block)]
        return [*verdicts, *self.finish()]

    def finish(self) -> tuple[Verdict, ...]:
        """Verdicts on the runs that are still open at the end of a recording."""
        ended = self._runs.finish()
        open_runs = [run for run in ended if len(run.segments) or self._judges[run.pump].lacking(run)]
        return tuple(self._judge(run, run.window_ns[1]) for run in open_runs)

    def snapshot(self) -> bytes:
        """The whole state, from which `restore` goes on bit for bit."""
        memories = [judge.memory for judge in self._judges]
        return encode_snapshot(self._station, self._datasheet, self._runs.state.remembered(), self._systems, memories)

    def restore(self, data: bytes) -> None:
        """Go on from a snapshot of the same station.

        Raises
        ------
        SnapshotError
            If it is damaged, of another format or station; this detector is left as it was.
        """
        arrays, systems, memories = decode_snapshot(data, self._station, self._datasheet)
        self._runs.restore(arrays)
        self._systems = systems
        for judge, memory in zip(self._judges, memories, strict=True):
            judge.memory = memory

    def rebaseline(self, pump: int, now_ns: int) -> Verdict:
        """Learn a pump (from 0) anew; what was learnt before is put aside and can be taken back."""
        self._judges[pump].memory.rebaseline(self._runs.seen_s)
        self._runs.begin_anew(pump, is_learning=True)
        self._runs.set_lacking_head(pump, lacks_head=False)
        self._systems[self._datasheet.main_of_pump[pump]] = SystemPrior()
        return self._told(pump, now_ns, "re-baselined by an operator")

    def revert(self, pump: int, now_ns: int) -> Verdict:
        """Take the baseline of a pump (from 0) back that was put aside last; without one nothing changes."""
        if not self._judges[pump].memory.revert():
            return self._told(pump, now_ns, "no baseline was put aside")
        self._runs.begin_anew(pump, is_learning=False)
        reference = self._judges[pump].memory.reference
        self._runs.set_lacking_head(pump, lacks_head=reference is not None and reference.baseline.lacks_head)
        return self._told(pump, now_ns, "baseline taken back by an operator")

    def severity(self, asset: str) -> Severity | None:
        """Severity of a pump or a main as it is now; None of other assets, and before the first run."""
        told = (judge.severity(asset, self._system(pump)) for pump, judge in enumerate(self._judges))
        return next((severity for severity in told if severity is not None), None)

    def pumps_of(self, asset: str) -> list[int]:
        """Pumps (from 0) that an asset concerns: itself, those of a main or of a meter; none if it is not here."""
        name = asset.partition(":")[2]
        return [
            pump
            for pump, judge in enumerate(self._judges)
            if asset in (judge.name, judge.main_name)
            or (asset.startswith("sensor:") and (name in STATION_QUANTITIES or pump_of(name) == pump + 1))
        ]

    def _judged(self, stop: int) -> list[Verdict]:
        """Verdicts where the loop over the samples has stopped."""
        now_ns = self._runs.now_ns
        if stop == Stop.SEGMENT_GATHERED:
            full = [self._watch_missing(pump, now_ns) for pump in self._runs.gathered_pumps()]
        elif stop == Stop.SEGMENT_FULL:
            full = [self._look_early(pump, now_ns) for pump in self._runs.full_pumps()]
        else:
            runs = self._runs.ended_runs() if stop == Stop.RUNS_ENDED else self._runs.newly_blind_runs()
            return [self._judge(run, max(now_ns, run.window_ns[1])) for run in runs]  # a clock may be set back
        return [verdict for verdict in full if verdict is not None]

    def _judge(self, run: Run, time_ns: int) -> Verdict:
        judge = self._judges[run.pump]
        judgement = judge.judge(run, time_ns, self._system(run.pump), [each.memory for each in self._judges])
        lacks_head = judge.does_without_head(run)
        if run.lacks_head and not lacks_head:
            judge.begin_learning()
        self._runs.set_lacking_head(run.pump, lacks_head=lacks_head)
        self._runs.set_learning(run.pump, is_learning=judge.memory.reference is None)
        return self._verdict(run.pump, time_ns, judgement)

    def _look_early(self, pump: int, now_ns: int) -> Verdict | None:
        """Verdict on a run that goes on, where one can be told before its end."""
        judge = self._judges[pump]
        if judge.memory.reference is None:
            return None
        segments = judge.segments_since_change(self._runs.last_segment(pump))
        if not segments:
            return None
        judgement = judge.look_early(self._runs.last_segments(pump, segments), self._system(pump))
        return None if judgement is None else self._verdict(pump, now_ns, judgement)

    def _watch_missing(self, pump: int, now_ns: int) -> Verdict | None:
        """Verdict on a pump that cannot be judged, when it begins or ceases to run as it used to."""
        gathered, lacking = self._runs.state.missing_signals[pump], self._runs.missing_now(pump)
        judgement = self._judges[pump].watch_missing(gathered, lacking, now_ns)
        return None if judgement is None else self._verdict(pump, now_ns, judgement)

    def _system(self, pump: int) -> SystemPrior:
        """Prior of the main of a pump."""
        return self._systems[self._datasheet.main_of_pump[pump]]

    def _told(self, pump: int, time_ns: int, reason: str) -> Verdict:
        return self._verdict(pump, time_ns, self._judges[pump].tell(time_ns, reason))

    def _verdict(self, pump: int, time_ns: int, judgement: Judgement) -> Verdict:
        """The verdict with what the last samples show by themselves, and the main where there are several."""
        if len(self._datasheet.mains) > 1:
            judgement.evidence["main"] = self._datasheet.main_of(pump).name
        tests = self._runs.rolling_tests(pump)
        if tests is not None:
            judgement.evidence["rolling_f_test"] = rolling_evidence(tests, self._runs.strongest_log_p(pump))
        faults = judgement.faults
        if faults is None:
            faults = self._judges[pump].faults(self._system(pump))
        worst = faults[0] if faults else None
        return Verdict(
            time=time_ns,
            station=self._station,
            pump=pump + 1,
            state=judgement.state,
            probability=judgement.probability,
            evidence=judgement.evidence,
            onset=judgement.onset_ns,
            window=judgement.window_ns,
            asset=None if worst is None else worst.asset,
            stage=None if worst is None else worst.stage,
            severity=None if worst is None else worst.severity,
            trend=None if worst is None else worst.trend,
            faults=faults,
        )
