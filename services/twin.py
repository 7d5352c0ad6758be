"""Deviations of a trial that never act: what is recorded is what would be recorded without them."""

from collections.abc import Collection
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


def hidden_names(case: TrialCase, path: Path, told: Collection[str]) -> list[str]:
    """Deviations that were not told, and without which the station records the same, value by value.

    Parameters
    ----------
    case : TrialCase
    path : Path
        Of its recording.
    told : collection of str
        Effects that the diagnosis has found.
    """
    recording = read_recording(path)
    return [name for name in case.names if name not in told and _is_same(recording, _without(case, name))]


def _without(case: TrialCase, name: str) -> Recording:
    others = tuple(deviation for deviation in case.truth.deviations if deviation.name != name)
    return recording_of(case, replace(case.truth, deviations=others))


def _is_same(recording: Recording, twin: Recording) -> bool:
    return all(
        np.allclose(values, twin.column(name), rtol=1e-6, atol=1e-9, equal_nan=True)
        for name, values in recording.columns.items()
    )
