"""No method at all: what a score is worth."""

from wetwell.detector.evaluation.methods.run_detector import RunDetector
from wetwell.detector.runs.run import Run
from wetwell.protocols.messages.verdict import State


class AlwaysNormal(RunDetector):
    """Tells every run normal."""

    def learn(self, pump: int, runs: list[Run]) -> None:
        pass

    def told(self, run: Run) -> State:  # noqa: ARG002
        return "normal"
