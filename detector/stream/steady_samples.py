"""Steady samples of the open runs, one record each, and the means of them over segments."""

from typing import Any

import numpy as np

from wetwell.detector.curves.datasheet import static_head_at_m
from wetwell.detector.curves.residuals import distances
from wetwell.protocols.arrays import Floats, Records
from wetwell.protocols.jit import compiled

SEGMENT_SAMPLES = 25
SEGMENT_S = 25.0
"""A feed slower than one sample a second has fewer samples in a segment, but one at least."""
LEAST_ROOM = 256
NO_FLOW_SHARE = 0.01
"""Share of the run-out flow below which the check valve is closed: then the main may take less than its curve."""

STEADY_SAMPLE = np.dtype(
    [
        (name, np.float64)
        for name in (
            "pump",
            "time_s",
            "flow_m3h",
            "head_m",
            "speed_ratio",
            "total_m3h",
            "level_m",
            "power_kw",
            "duty_m3h",
            "duty_total_m3h",
        )
    ]
)
"""Time since the start of the part of the run; `duty_m3h` as Q/N and `duty_total_m3h` are by the datasheet."""
SEGMENT_MEANS = ("flow_m3h", "total_m3h", "duty_m3h", "duty_total_m3h", "level_m", "speed_ratio")
"""What the mean of a segment is known of, beside both residuals; named as in `Segments`."""
SEGMENT_SUM = np.dtype([(name, np.float64) for name in ("pump_m", "system_m", *SEGMENT_MEANS)])


def new_steady_samples(room: int = LEAST_ROOM) -> Records:
    """Room for so many steady samples."""
    return np.zeros(room, dtype=STEADY_SAMPLE)


@compiled
def _sum_segments(own: Any, steady_samples: Any, samples: int, sums: Any) -> None:
    """Add the samples of each segment to its sums, which begin at 0; `own` is the pump in the table."""
    for segment in range(sums.shape[0]):
        total = sums[segment]
        for at in range(segment * samples, (segment + 1) * samples):
            steady = steady_samples[at]
            pump_m, system_m = distances(
                *(steady["flow_m3h"], steady["head_m"], steady["speed_ratio"], steady["total_m3h"]),
                *(own["c0"], own["c1"], own["c2"], static_head_at_m(own, steady["level_m"]), own["friction_h2_m5"]),
            )
            is_closed = steady["total_m3h"] < NO_FLOW_SHARE * own["runout_m3h"] and system_m < 0.0
            total["pump_m"] += pump_m
            total["system_m"] += 0.0 if is_closed else system_m
            total["flow_m3h"] += steady["flow_m3h"] / steady["speed_ratio"]
            total["total_m3h"] += steady["total_m3h"]
            total["duty_m3h"] += steady["duty_m3h"]
            total["duty_total_m3h"] += steady["duty_total_m3h"]
            total["level_m"] += steady["level_m"]
            total["speed_ratio"] += steady["speed_ratio"]


def segment_averages(own: Any, steady_samples: Any, samples: int) -> tuple[Floats, dict[str, Floats]]:
    """(m, 2) mean residuals of the segments of so many samples, and their other means by name; a rest is left out."""
    sums = np.zeros(len(steady_samples) // samples, dtype=SEGMENT_SUM)
    _sum_segments(own, steady_samples, samples, sums)
    residual_m = np.column_stack((sums["pump_m"], sums["system_m"])) / samples
    return residual_m, {name: sums[name] / samples for name in SEGMENT_MEANS}
