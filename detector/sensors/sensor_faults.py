"""Meters that a run shows to be wrong without any doubt."""

import math
from collections.abc import Mapping
from typing import Any

from wetwell.detector.pump_judge import Knowledge
from wetwell.detector.runs.run import Run
from wetwell.detector.stream.stuck_sensors import noisy_meters
from wetwell.protocols.quantities import pump_column

DEAD_LOG_RATIO = -1.5
"""A flow meter that shows less than a fifth of what leaves the wet well, against health, is dead."""
WAYS = ("stuck", "dead", "lost", "noisy")
"""In which a meter can be wrong."""


def silencing_meters(pump: int, known: Knowledge | None, stuck: list[str], log_ratio: float) -> dict[str, list[str]]:
    """Meters of a run that say nothing of the pump (from 0): stuck, or dead while the wet well draws down.

    Parameters
    ----------
    known : Knowledge or None
        What was learnt of the pump.
    stuck : list of str
        Readings that were stuck in the run.
    log_ratio : float
        Log of measured flow over drawdown of the run; NaN without one.

    Returns
    -------
    wrong : dict
        Names of the meters by the way in which they are wrong.
    """
    if any(name.endswith(("flow_m3h", "head_m")) for name in stuck):
        return {"stuck": stuck}
    if known is not None and log_ratio - known.drawdown.mean < DEAD_LOG_RATIO:
        return {"dead": [pump_column(pump + 1, "flow_m3h")]}
    return {}


def doubtful_meters(run: Run, known: Knowledge, stuck: list[str]) -> dict[str, list[str]]:
    """Meters that are wrong, while the run can be judged all the same; as of `silencing_meters`."""
    is_level_lost = "level_m" in run.missing and math.isfinite(known.baseline.level_m)
    wrong = {
        "noisy": sorted(noisy_meters(run, known.noise)),
        "stuck": stuck,
        "lost": ["level_m"] if is_level_lost else [],
    }
    return {how: names for how, names in wrong.items() if names}


def in_words(wrong: Mapping[str, Any]) -> str:
    """Which meters are wrong, and how.

    Examples
    --------
    >>> in_words({"stuck": ["level_m", "pump1_flow_m3h"]})
    'level_m and pump1_flow_m3h stuck'
    """
    return ", ".join(f"{' and '.join(wrong[how])} {how}" for how in WAYS if how in wrong)
