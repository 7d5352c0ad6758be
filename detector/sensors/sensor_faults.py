"""Sensors that a run shows to be wrong without any doubt."""

import math
from collections.abc import Mapping
from typing import Any

from wetwell.detector.baseline.healthy_reference import HealthyReference
from wetwell.detector.runs.run import Run
from wetwell.detector.sensors.sensor_noise import noisy_sensors
from wetwell.protocols.quantities import pump_column

DEAD_LOG_RATIO = -1.5
"""A flow meter that shows less than a fifth of what leaves the wet well, against health, is dead."""
WAYS = ("stuck", "dead", "lost", "noisy")
"""In which a sensor can be wrong."""


def silencing_sensors(run: Run, reference: HealthyReference | None) -> dict[str, list[str]]:
    """Sensors of a run that say nothing of the pump: stuck, or dead while the wet well draws down.

    Parameters
    ----------
    run : Run
    reference : HealthyReference or None
        What was learnt of the pump.

    Returns
    -------
    wrong : dict
        Names of the sensors by the way in which they are wrong.
    """
    if any(name.endswith(("flow_m3h", "head_m")) for name in run.stuck):
        return {"stuck": run.stuck}
    if reference is not None and run.log_ratio - reference.drawdown.mean < DEAD_LOG_RATIO:
        return {"dead": [pump_column(run.pump + 1, "flow_m3h")]}
    return {}


def doubtful_sensors(run: Run, reference: HealthyReference) -> dict[str, list[str]]:
    """Sensors that are wrong, while the run can be judged all the same; as of `silencing_sensors`."""
    is_level_lost = "level_m" in run.missing and math.isfinite(reference.baseline.level_m)
    wrong = {
        "noisy": sorted(noisy_sensors(run, reference.noise)),
        "stuck": run.stuck,
        "lost": ["level_m"] if is_level_lost else [],
    }
    return {how: names for how, names in wrong.items() if names}


def in_words(wrong: Mapping[str, Any]) -> str:
    """Which sensors are wrong, and how.

    Examples
    --------
    >>> in_words({"stuck": ["level_m", "pump1_flow_m3h"]})
    'level_m and pump1_flow_m3h stuck'
    """
    return ", ".join(f"{' and '.join(wrong[how])} {how}" for how in WAYS if how in wrong)
