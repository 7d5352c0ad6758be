"""A case whose deviations all matter: drawn anew where one of them moves nothing by more than is material.

So is one whose pumps run the wet well dry: what they take then no two models say alike. And so is one whose plant
loses the solution of its own equations.
"""

from dataclasses import replace

from wetwell.protocols.errors import WetwellError
from wetwell.protocols.recordings.recording import Recording
from wetwell.services.trial.plants import Passes, passage_of
from wetwell.services.trial.swmm_plant import SolutionLostError
from wetwell.sim2real.trial.cases import TrialCase
from wetwell.sim2real.trial.families import PlantName
from wetwell.sim2real.trial.materiality import moved
from wetwell.sim2real.trial.readings import Readings, readings_of
from wetwell.sim2real.truth.case import TruthCase
from wetwell.sim2real.truth.storage import EVERY_SECOND, stored

DRY_M = 0.01
"""Level of a wet well that is dry. [m]"""
ATTEMPTS = 8
"""Draws after which a case is given up: a short recording may have no room for its effect."""


def material_case(case: TrialCase) -> tuple[TrialCase, TruthCase, Recording]:
    """The case in its first attempt that stands for reality, with its truth and its recording.

    There every deviation matters, the wet well holds water, and the plant its own equations. A twin without a
    deviation tells whether it matters, second by second and without the noise of the sensors; what the historian
    keeps of the seconds does not count, but for signals that it does not keep at all.

    Raises
    ------
    WetwellError
        If there is none among `ATTEMPTS`, or its plant is not installed.
    """
    why = ""
    for attempt in range(ATTEMPTS):
        case = replace(case, attempt=attempt)
        truth = case.truth()
        try:
            passage = _passage_of(truth, case.plant)
            why = _why_unfit(truth, case.plant, passage)
        except SolutionLostError as error:
            why = str(error)
        if not why:
            return case, truth, stored(passage.recording(truth=False), truth.storage)
    raise WetwellError(f"{case.name}: none of {ATTEMPTS} draws stands for reality; in the last one {why}")


def _why_unfit(truth: TruthCase, plant: PlantName, passage: Passes) -> str:
    """Why a case is drawn anew; empty if it is not."""
    if passage.lowest_level_m < DRY_M:
        return f"the pumps of plant '{plant}' run the wet well dry"
    small = immaterial_name(truth, plant, passage)
    if small:
        return (
            f"'{small}' moves nothing that plant '{plant}' records by more than is material: "
            "a longer recording may show it"
        )
    return ""


def immaterial_name(truth: TruthCase, plant: PlantName, passage: Passes | None = None) -> str:
    """First deviation without which the plant reads the same but for what nobody acts on; empty if all matter.

    Parameters
    ----------
    truth : TruthCase
    plant : PlantName
    passage : Passes, optional
        Of the truth with a row a second, where it is at hand.
    """
    if not truth.deviations:
        return ""
    readings = _readings(truth, passage or _passage_of(truth, plant))
    for deviation in truth.deviations:
        others = tuple(other for other in truth.deviations if other is not deviation)
        twin = replace(truth, deviations=others)
        if moved(readings, _readings(twin, _passage_of(twin, plant))) <= 1.0:
            return deviation.name
    return ""


def _passage_of(truth: TruthCase, plant: PlantName) -> Passes:
    return passage_of(replace(truth, storage=EVERY_SECOND), plant)


def _readings(truth: TruthCase, passage: Passes) -> Readings:
    return readings_of(passage.oracle(), truth.station, truth.storage.absent)
