"""How often the detector calls a fault on a recording, with the curves of the station file and with others."""

from dataclasses import dataclass, replace

import numpy as np

from wetwell.detector.curves.datasheet import Datasheet, SystemCurve, datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.evaluation.scores import FAULTS, without_truth
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.simulator.effects import effective_parameters

MOST_JUDGED_S = 86_400
"""Of a longer recording the first part is judged. [s]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class FalseVerdicts:
    """Verdicts with a fault on a recording that is taken to be healthy, with both stations.

    Attributes
    ----------
    days : float
        Length of what the detector saw, the hours in which it learns included.
    verdicts : int
        All that it gave with the station as it was.
    before, after : int
        Those that call a fault of a pump, of the main, or of both.
    has_new_curves : bool
        Whether the effects change a curve that the detector takes its residuals from; else both are the same.
    """

    days: float
    verdicts: int
    before: int
    after: int
    has_new_curves: bool


def false_verdicts(recording: Recording, before: Station, after: Station) -> FalseVerdicts:
    """Let the detector judge a recording with the station as configured and as diagnosed.

    The recording is taken to be healthy: what is diagnosed is how the station is, not what has happened to it.
    The detector learns the offsets of the first hours, so that a constant effect makes hardly any difference to it.
    """
    seen = without_truth(_first_part(recording))
    old, new = _datasheet(before), _datasheet(after)
    verdicts, faults = _judged(seen, before.name, old)
    again = faults if new == old else _judged(seen, before.name, new)[1]
    days = float(seen.time_ns[-1] - seen.time_ns[0]) / NS_PER_S / 86_400.0
    return FalseVerdicts(days=days, verdicts=verdicts, before=faults, after=again, has_new_curves=new != old)


def _judged(recording: Recording, name: str, datasheet: Datasheet) -> tuple[int, int]:
    """Verdicts, and those with a fault."""
    verdicts = Detector(name, datasheet).judge(recording)
    return len(verdicts), sum(verdict.state in FAULTS for verdict in verdicts)


def _datasheet(station: Station) -> Datasheet:
    """Curves of a station under its effects."""
    plant = effective_parameters(station)
    return replace(
        datasheet_of(station),
        curves=tuple((float(c0), float(c1), float(c2)) for c0, c1, c2 in plant.curves),
        mains=tuple(
            SystemCurve(
                static_head_m=main.static_head_m,
                friction_h2_m5=main.friction_h2_m5,
                is_common_header=main.is_common_header,
                level_slope=main.level_slope,
            )
            for main in plant.mains
        ),
    )


def _first_part(recording: Recording) -> Recording:
    rows = slice(0, int(np.searchsorted(recording.time_ns, recording.time_ns[0] + MOST_JUDGED_S * NS_PER_S)))
    return replace(
        recording,
        time_ns=recording.time_ns[rows],
        columns={name: values[rows] for name, values in recording.columns.items()},
        truth={},
    )
