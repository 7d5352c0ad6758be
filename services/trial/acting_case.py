"""A case whose deviations all act: drawn anew where the recording would be the same without one of them."""

from dataclasses import replace

import numpy as np

from wetwell.protocols.errors import WetwellError
from wetwell.protocols.recordings.recording import Recording
from wetwell.services.trial.plants import passage_of
from wetwell.sim2real.trial.cases import TrialCase
from wetwell.sim2real.trial.families import FAMILIES, PlantName
from wetwell.sim2real.truth.case import TruthCase
from wetwell.sim2real.truth.storage import EVERY_SECOND, stored

ATTEMPTS = 8
"""Draws after which a case is given up: a short recording may have no room for its effect."""


def acting_case(case: TrialCase) -> tuple[TrialCase, TruthCase, Recording]:
    """The case in its first attempt in which every deviation changes a value of a second, with truth and recording.

    Only deviations of a kind that may never act are looked at, by a twin that is made without them; what the
    historian keeps of the seconds does not count.

    Raises
    ------
    WetwellError
        If there is none among `ATTEMPTS`, or its plant is not installed.
    """
    idle = ""
    for attempt in range(ATTEMPTS):
        case = replace(case, attempt=attempt)
        truth = case.truth()
        sensed = replace(truth, storage=EVERY_SECOND)
        recording = recording_of(sensed, case.plant)
        idle = idle_name(sensed, case.plant, recording)
        if not idle:
            return case, truth, stored(recording, truth.storage)
    raise WetwellError(
        f"{case.name}: '{idle}' changes no recorded value of plant '{case.plant}' in any of {ATTEMPTS} draws: "
        "a longer recording may show it"
    )


def recording_of(truth: TruthCase, plant: PlantName) -> Recording:
    """What a plant records of a truth."""
    return passage_of(truth, plant).recording(truth=False)


def idle_name(truth: TruthCase, plant: PlantName, recording: Recording) -> str:
    """First deviation without which the plant records the same, value by value; empty if all act."""
    for deviation in truth.deviations:
        if FAMILIES[plant].kinds[deviation.name].may_never_act:
            others = tuple(other for other in truth.deviations if other is not deviation)
            if _is_same(recording, recording_of(replace(truth, deviations=others), plant)):
                return deviation.name
    return ""


def _is_same(recording: Recording, twin: Recording) -> bool:
    return all(
        np.allclose(values, twin.column(name), rtol=1e-6, atol=1e-9, equal_nan=True)
        for name, values in recording.columns.items()
    )
