"""What all baselines share: gate, pump runs and a learning phase, as the detector beside them has them."""

from abc import ABC, abstractmethod

from wetwell.detector.baseline.model import MIN_RUNS, MIN_SEGMENTS
from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.runs.run import Run
from wetwell.detector.runs.run_tracker import RunTracker
from wetwell.detector.stream.block import Block
from wetwell.detector.stream.loop import Stop
from wetwell.detector.stream.run_state import NEEDED
from wetwell.detector.stream.steady_samples import SEGMENT_SAMPLES
from wetwell.protocols.messages.verdict import State, Verdict
from wetwell.protocols.timestamps import LEARNING_S, NS_PER_S

ALPHA = 1e-3
"""Share of healthy runs in which one test may reject, for the methods of which nobody has said another."""


class RunDetector(ABC):
    """One hard verdict at the end of each run: what a method says of it, or `learning`, or `unknown` without data.

    A method is a class with `learn` and `told`, which are given runs; what it keeps is its own affair.

    Unlike the detector, a baseline takes whatever comes in the first six hours as healthy, and has no early verdicts,
    no memory between pumps and no probabilities: `probability` holds the told state with 1.

    Parameters
    ----------
    station : str
        Name for the verdicts.
    datasheet : Datasheet
        Datasheet curves.
    """

    def __init__(self, station: str, datasheet: Datasheet) -> None:
        self._station = station
        self._datasheet = datasheet
        self._runs = RunTracker(datasheet)
        self._learning: list[list[Run] | None] = [[] for _ in range(datasheet.pumps)]
        self._begin_ns: int | None = None

    def update_block(self, block: Block) -> list[Verdict]:
        """Verdicts that a block of samples brings."""
        if self._begin_ns is None and len(block.time_ns):
            self._begin_ns = int(block.time_ns[0])
        verdicts = list[Verdict]()
        for stop in self._runs.stops(block.in_one_piece()):
            if stop == Stop.RUNS_ENDED:
                verdicts += [self._judge(run, self._runs.now_ns) for run in self._runs.ended_runs()]
        return verdicts

    def finish(self) -> tuple[Verdict, ...]:
        """Verdicts on the runs that are still open at the end of a recording."""
        return tuple(self._judge(run, run.window_ns[1]) for run in self._runs.finish())

    @abstractmethod
    def learn(self, pump: int, runs: list[Run]) -> None:
        """Take the runs of the learning phase of a pump (from 0); called once for each."""

    @abstractmethod
    def told(self, run: Run) -> State:
        """State of a run with at least 25 steady samples, after learning."""

    def _judge(self, run: Run, time_ns: int) -> Verdict:
        state = self._state(run, time_ns)
        return Verdict(
            time=time_ns,
            station=self._station,
            pump=run.pump + 1,
            state=state,
            probability={state: 1.0},
            evidence={"steady_samples": len(run.time_s)},
            window=run.window_ns,
        )

    def _state(self, run: Run, time_ns: int) -> State:
        if run.missing & NEEDED:
            return "unknown"
        learnt = self._learning[run.pump]
        if learnt is not None:
            assert self._begin_ns is not None  # noqa: S101 - a run has samples
            if len(learnt) < MIN_RUNS or time_ns - self._begin_ns <= LEARNING_S * NS_PER_S:
                if len(run.time_s) >= MIN_SEGMENTS * SEGMENT_SAMPLES:
                    learnt.append(run)
                return "learning"
            self.learn(run.pump, learnt)
            self._learning[run.pump] = None
        return self.told(run) if len(run.time_s) >= SEGMENT_SAMPLES else "unknown"


def state_of(*, pump: bool, system: bool) -> State:
    """State by which of the two curves has moved."""
    if pump:
        return "pump_and_system_fault" if system else "pump_fault"
    return "system_fault" if system else "normal"
