"""Trials of several families side by side: what each scores that was left out of the learning."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from wetwell.protocols.errors import ConfigError
from wetwell.services.trial.plan import TRIAL_SCHEMA
from wetwell.sim2real.trial.families import PLANTS

SCORES = ("verdict_right", "exact_set", "top_1", "top_2", "component_right", "false_attribution", "interval_coverage")


def families_table(folders: Sequence[Path], learnt_on: Sequence[str] = ()) -> dict[str, object]:
    """Scores of each family over trials, and whether it was left out.

    Parameters
    ----------
    folders : sequence of Path
        Each with a `trial.json`.
    learnt_on : sequence of str
        Families that constants were learnt on; all others were left out.

    Raises
    ------
    ConfigError
        If there is no result, it has another schema, or a family is not known.
    """
    if unknown := sorted(set(learnt_on) - set(PLANTS)):
        raise ConfigError(f"--learnt-on: got '{unknown[0]}', must be of {', '.join(PLANTS)}")
    rows = [
        {
            "family": plant,
            "left out": "no" if plant in learnt_on else "yes",
            "seed": result["seed"],
            "cases": scores["cases"],
            **{name: _told(scores[name]) for name in SCORES},
            "calibration_error": _error(result, plant),
        }
        for result in map(_result_in, folders)
        for plant, scores in result["plants_scored"].items()
    ]
    return {"scores": sorted(rows, key=lambda row: (PLANTS.index(row["family"]), row["seed"]))}


def _result_in(folder: Path) -> dict[str, Any]:
    path = folder / "trial.json"
    try:
        result: dict[str, Any] = json.loads(path.read_bytes())
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise ConfigError(f"{path}: is not JSON: {error}") from error
    if result.get("schema") != TRIAL_SCHEMA:
        raise ConfigError(
            f"{path}: schema is {result.get('schema')!r}, must be '{TRIAL_SCHEMA}': score the trial again"
        )
    return result


def _told(share: Mapping[str, Any] | None) -> str:
    return "-" if share is None else f"{share['value']:.2f} [{share['ci'][0]:.2f}, {share['ci'][1]:.2f}]"


def _error(result: Mapping[str, Any], plant: str) -> str:
    found = result["reliability"].get(plant)
    return "-" if found is None else f"{found['calibration_error']:.3f}"
