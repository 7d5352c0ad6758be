"""Cases of a trial whose deviation never acts: what is recorded is what would be recorded without it."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from wetwell.protocols.recording import Recording, read_recording
from wetwell.services.swmm_plant import run_swmm
from wetwell.sim2real.trial.cases import TrialCase
from wetwell.sim2real.truth import truth_plant
from wetwell.sim2real.truth.case import TruthCase


def recording_of(case: TrialCase, truth: TruthCase) -> Recording:
    """What the plant of a case records of a truth."""
    return (truth_plant.run if case.plant == "fine" else run_swmm)(truth, truth=False)


def is_hidden(case: TrialCase, path: Path) -> bool:
    """Whether each value of a recording is what the station records in the same weather without its deviations."""
    recording, twin = read_recording(path), recording_of(case, replace(case.truth, deviations=()))
    return bool(case.names) and all(
        np.allclose(values, twin.column(name), rtol=1e-6, atol=1e-9, equal_nan=True)
        for name, values in recording.columns.items()
    )
