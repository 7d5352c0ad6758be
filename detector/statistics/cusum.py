"""Two-sided CUSUM over the segments of a run: when to look, before the run is over."""

from dataclasses import dataclass, field

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import compiled

DEAD_BAND = 0.75
THRESHOLD = 5.0
LARGEST_STEP = 3.0
"""A step counts no more than this after the dead band is taken off, so that one burst alone does not trip."""


@compiled
def _update(sums: Floats, since: Floats, shift_m: Floats, deviation_m: Floats) -> int:
    tripped = 0
    for residual in range(2):
        z = shift_m[residual] / deviation_m[residual]
        for way in range(2):
            step = min((-z if way else z) - DEAD_BAND, LARGEST_STEP)
            sums[way, residual] = max(sums[way, residual] + step, 0.0)
            since[way, residual] = since[way, residual] + 1.0 if sums[way, residual] > 0.0 else 0.0
            if sums[way, residual] > THRESHOLD:
                tripped = max(tripped, int(since[way, residual]))
    return tripped


@dataclass(slots=True)
class Cusum:
    r"""Sums of how far segments lie beyond a dead band, each way, for both residuals.

    $$S^\pm \leftarrow \max\bigl(0,\ S^\pm + \min(\pm z - d,\ c)\bigr), \qquad z = \frac{\Delta r}{\sigma}$$

    Attributes
    ----------
    sums : (2, 2) array
        S+ and S- of (r_p, r_s).
    since : (2, 2) array
        Segments since each was 0 last: where a change has most likely begun.

    References
    ----------
    .. [1] E. S. Page, Continuous inspection schemes, Biometrika 41, 1954.
    """

    sums: Floats = field(default_factory=lambda: np.zeros((2, 2)))
    since: Floats = field(default_factory=lambda: np.zeros((2, 2)))

    def update(self, shift_m: Floats, deviation_m: Floats) -> int:
        """Segments since the change that has tripped, 0 if none has; (2,) shift of a segment and its σ. [m]."""
        return _update(self.sums, self.since, shift_m, deviation_m)

    def reset(self) -> None:
        """Begin anew, at the start of a run."""
        self.sums = np.zeros((2, 2))
        self.since = np.zeros((2, 2))
