"""Other detectors, to hold ours against: the paper's two as written, their best plain reading, and outside ones.

Each is one small class with `update_block` and `finish` as `wetwell.detector.detector.Detector` has them. Those on
statsmodels and river need the extra `baselines` (`pip install wetwell[baselines]`) and are loaded only when asked
for.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Protocol

from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.stream.block import Block
from wetwell.protocols.errors import ConfigError
from wetwell.protocols.messages.verdict import Verdict


class StreamDetector(Protocol):
    """What judges the samples of one station."""

    def update_block(self, block: Block) -> list[Verdict]:
        """Verdicts that a block of samples brings."""

    def finish(self) -> tuple[Verdict, ...]:
        """Verdicts on the runs that are still open."""


DETECTORS = {
    "wetwell": "wetwell.detector.detector:Detector",
    "paper_f_test": "wetwell.detector.evaluation.methods.paper_f_test:PaperFTest",
    "paper_tangent": "wetwell.detector.evaluation.methods.paper_tangent:PaperTangent",
    "paper_f_shift": "wetwell.detector.evaluation.methods.paper_f_shift:PaperFShift",
    "paper_tangent_segments": "wetwell.detector.evaluation.methods.paper_tangent_segments:PaperTangentSegments",
    "cusum_statsmodels": "wetwell.detector.evaluation.methods.cusum_statsmodels:CusumStatsmodels",
    "river_adwin": "wetwell.detector.evaluation.methods.river_drift:RiverAdwin",
    "river_page_hinkley": "wetwell.detector.evaluation.methods.river_drift:RiverPageHinkley",
    "always_normal": "wetwell.detector.evaluation.methods.always_normal:AlwaysNormal",
}
"""Module and class of each detector by name."""


def detector_class(name: str) -> Callable[[str, Datasheet], StreamDetector]:
    """Class of a detector by its name in `DETECTORS`; called with the station's name and its datasheet curves.

    Raises
    ------
    ConfigError
        If there is none of this name, or the package that it rests on is not installed.
    """
    if name not in DETECTORS:
        raise ConfigError(f"detector '{name}' is none of {', '.join(DETECTORS)}")
    module, _, attribute = DETECTORS[name].partition(":")
    try:
        found: Callable[[str, Datasheet], StreamDetector] = getattr(import_module(module), attribute)
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"detector '{name}' needs the package {error.name}: pip install wetwell[baselines]"
        ) from error
    return found
