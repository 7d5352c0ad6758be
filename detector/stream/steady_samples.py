"""Steady samples of the open runs, one record each, and the means of them over segments."""

from typing import Any

import numpy as np

from wetwell.detector.curves.datasheet import static_head_at_m
from wetwell.detector.curves.residuals import distances
from wetwell.protocols.arrays import Floats, Records
from wetwell.protocols.jit import SameTypes, compiled

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
"""What the mean of a segment is known of, after both residuals; named as in `Segments`."""


def new_steady_samples(room: int = LEAST_ROOM) -> Records:
    """Room for so many steady samples."""
    return np.zeros(room, dtype=STEADY_SAMPLE)


@SameTypes
@compiled
def _average_segments(own: Any, steady_samples: Any, samples: int, residual_m: Floats, means: Floats) -> None:
    """Mean of each segment, in the place of zeros; `own` is the pump in the table."""
    flow_m3h, total_m3h, duty_m3h, duty_total_m3h, level_m, speed_ratio = means
    for segment in range(means.shape[1]):
        for at in range(segment * samples, (segment + 1) * samples):
            steady = steady_samples[at]
            pump_m, system_m = distances(
                *(steady["flow_m3h"], steady["head_m"], steady["speed_ratio"], steady["total_m3h"]),
                *(own["c0"], own["c1"], own["c2"], static_head_at_m(own, steady["level_m"]), own["friction_h2_m5"]),
            )
            is_closed = steady["total_m3h"] < NO_FLOW_SHARE * own["runout_m3h"] and system_m < 0.0
            residual_m[segment, 0] += pump_m
            residual_m[segment, 1] += 0.0 if is_closed else system_m
            flow_m3h[segment] += steady["flow_m3h"] / steady["speed_ratio"]
            total_m3h[segment] += steady["total_m3h"]
            duty_m3h[segment] += steady["duty_m3h"]
            duty_total_m3h[segment] += steady["duty_total_m3h"]
            level_m[segment] += steady["level_m"]
            speed_ratio[segment] += steady["speed_ratio"]
        for residual in range(residual_m.shape[1]):
            residual_m[segment, residual] /= samples
        for quantity in range(means.shape[0]):
            means[quantity, segment] /= samples


def segment_averages(own: Any, steady_samples: Any, samples: int) -> tuple[Floats, dict[str, Floats]]:
    """(m, 2) mean residuals of the segments of so many samples, and their other means by name; a rest is left out."""
    segments = len(steady_samples) // samples
    residual_m, means = np.zeros((segments, 2)), np.zeros((len(SEGMENT_MEANS), segments))
    _average_segments(own, steady_samples, samples, residual_m, means)
    return residual_m, dict(zip(SEGMENT_MEANS, means, strict=True))
