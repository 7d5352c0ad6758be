"""The plants that stand for reality, by name."""

from typing import Protocol

from wetwell.protocols.recordings.recording import Recording
from wetwell.services.trial.swmm_plant import swmm_passage_of
from wetwell.sim2real.trial.families import PlantName
from wetwell.sim2real.truth import truth_plant
from wetwell.sim2real.truth.case import TruthCase
from wetwell.sim2real.truth.elastic import plant as elastic_plant


class Passes(Protocol):
    """What a plant has noted of a case."""

    @property
    def lowest_level_m(self) -> float:
        """Lowest true level of the wet well. [m]."""

    def recording(self, *, truth: bool) -> Recording:
        """What is recorded; a blind recording has no truth columns."""

    def oracle(self) -> Recording:
        """What sensors without noise would have recorded."""


def passage_of(case: TruthCase, plant: PlantName) -> Passes:
    """A plant's passage through a case.

    Raises
    ------
    WetwellError
        If the plant is not installed.
    ValueError
        If it cannot express a deviation of the case.
    """
    match plant:
        case "fine":
            return truth_plant.passage_of(case)
        case "swmm":
            return swmm_passage_of(case)
        case "elastic":
            return elastic_plant.passage_of(case)
