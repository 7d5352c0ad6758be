"""How fast a feed comes: its usual step, told from the last few and bent by none that stands out."""

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import compiled

STEPS_HEARD = 5
"""Steps of which the usual one is the lower median: two that stand out do not move it."""
SLOWEST_STEP_S = 1800.0
"""A row in 15 min, of which one is missing: a longer step is a gap or a wrong stamp. [s]"""
USUAL, NEWEST = 0, 1
"""Places in the steps of a feed: the usual one, then those that were heard, the newest first. [s]"""


def new_sampling_steps() -> Floats:
    """Steps of a feed before its second sample: 0 is not known."""
    return np.zeros(NEWEST + STEPS_HEARD)


@compiled
def note_step(steps: Floats, step_s: float) -> None:
    """Take a step between two samples into account; the usual one is the lower median of the last five."""
    if not 0.0 < step_s <= SLOWEST_STEP_S:
        return
    for place in range(STEPS_HEARD, NEWEST, -1):
        steps[place] = steps[place - 1]
    steps[NEWEST] = step_s
    known = 0
    for place in range(NEWEST, NEWEST + STEPS_HEARD):
        known += steps[place] > 0.0
    for place in range(NEWEST, NEWEST + known):
        below = same = 0
        for other in range(NEWEST, NEWEST + known):
            below += steps[other] < steps[place]
            same += steps[other] == steps[place]
        if below <= (known - 1) // 2 < below + same:
            steps[USUAL] = steps[place]
            return
