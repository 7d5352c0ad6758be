"""Shrinkage that the trial measures itself: diagnosed stations replayed on a recording that nobody has seen."""

import json
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.recordings.recording import Recording, read_recording, write_recording
from wetwell.services.batch.executors import let_interrupts
from wetwell.services.trial.plants import passage_of
from wetwell.services.trial.sealed_case import RECORDING_FILE, STATION_FILE
from wetwell.sim2real.trial.cases import TrialCase
from wetwell.sim2real.trial.holdout import gap, shrinkage, whitened
from wetwell.sim2real.trial.regressor import corrected

HOLDOUT_FILE = "held_out.json"
_TIMEOUT_S = 600.0


def measure_holdout(case: TrialCase, published: Path, reports: Path, command: Sequence[str]) -> None:
    """Write `held_out.json` beside a report: gap before and after on other weather and noise, and what bounds it.

    Nothing is written where there is no diagnosed station, or the replay fails.

    Parameters
    ----------
    case : TrialCase
        In the attempt that is published.
    published, reports : Path
        Folders with station and recording as published, and with the diagnosed station.
    command : sequence of str
        The replay; it gets `--station FILE --recording FILE --out FILE`.
    """
    if (reports / HOLDOUT_FILE).is_file() or not (reports / STATION_FILE).is_file():
        return
    truth = case.truth()
    holdout_truth = replace(truth, seed=truth.seed + 1)
    passage = passage_of(holdout_truth, case.plant)
    recorded, oracle = passage.recording(truth=False), passage.oracle()
    with tempfile.TemporaryDirectory(prefix="held-out-") as room:
        holdout = Path(room) / "unseen.parquet"
        write_recording(recorded, holdout)
        before = _replayed(command, published / STATION_FILE, holdout)
        after = _replayed(command, reports / STATION_FILE, holdout)
        first = _replayed(command, published / STATION_FILE, published / RECORDING_FILE, Path(room))
    if before is None or after is None or first is None:
        return
    bound = corrected(first, read_recording(published / RECORDING_FILE), before)
    sensors = truth.station.sensors
    gaps = {
        name: gap(whitened(predicted, recorded, sensors))
        for name, predicted in (("before", before), ("after", after), ("oracle", oracle), ("regressor", bound))
    }
    is_shown = set(case.components) != {"controller"}  # a replay is given what a controller does
    figures: dict[str, Any] = {
        **gaps,
        "shrinkage": shrinkage(gaps["before"], gaps["after"], gaps["oracle"]) if is_shown else None,
        "regressor_shrinkage": shrinkage(gaps["before"], gaps["regressor"], gaps["oracle"]) if is_shown else None,
    }
    with atomic_file(reports / HOLDOUT_FILE) as file:
        file.write(json.dumps(figures).encode() + b"\n")


def _replayed(command: Sequence[str], station: Path, recording: Path, room: Path | None = None) -> Recording | None:
    out = (room or recording.parent) / f"replayed-{station.parent.name}-{recording.stem}.parquet"
    arguments = ["--station", str(station), "--recording", str(recording), "--out", str(out)]
    try:
        with let_interrupts():
            done = subprocess.run(  # noqa: S603 - the command is the user's own
                [*command, *arguments],
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=_TIMEOUT_S,
                check=False,
            )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return read_recording(out) if done.returncode == 0 and out.is_file() else None


def holdout_summary(folders: Sequence[Path]) -> dict[str, Any] | None:
    """Medians over the cases that have `held_out.json`; None without any.

    Shrinkages of cases without a gap in these signals (controller, thresholds) are left out and counted.
    """
    rows = [json.loads(path.read_bytes()) for folder in folders if (path := folder / HOLDOUT_FILE).is_file()]
    if not rows:
        return None
    told: dict[str, Any] = {"cases": len(rows)}
    for name in ("shrinkage", "regressor_shrinkage"):
        values = [row[name] for row in rows if row[name] is not None]
        told[name] = {"median": float(np.median(values)), "count": len(values)} if values else None
    for name in ("before", "after", "oracle", "regressor"):
        told[name] = float(np.median([row[name] for row in rows]))
    return told
