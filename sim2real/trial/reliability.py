"""Whether the probabilities that are told hold: of what is said with .9, nine in ten are right."""

from collections.abc import Sequence
from typing import Any

import numpy as np

BINS = 10
"""Bins of equal width around the tenths; the first and the last are half as wide. Most answers are told with .8, as
nobody is surer that what is known is all there is: an edge there would part what is the same."""


def reliability(told: Sequence[tuple[float, bool]]) -> dict[str, Any] | None:
    r"""Bins of what was said and how often it was right, and the expected calibration error; None without any.

    $$\mathrm{ECE} = \sum_b \frac{n_b}{n} \left| \overline{y}_b - \overline{p}_b \right|$$

    over bins around the tenths. Range 0 to 1, best 0; of n answers that are calibrated it is about
    $\sqrt{2 / \pi} \sum_b \sqrt{n_b\, p_b (1 - p_b)} / n$ by chance alone, given as `chance`.

    Parameters
    ----------
    told : sequence of (probability, is_right)
        Of the answer that each case gave most.

    References
    ----------
    .. [1] M. P. Naeini, G. Cooper, M. Hauskrecht, Obtaining well calibrated probabilities using Bayesian binning,
       AAAI 2015.

    Examples
    --------
    >>> found = reliability([(0.95, True)] * 9 + [(0.95, False)])
    >>> round(found["calibration_error"], 3), found["bins"][0]["cases"]
    (0.05, 10)
    """
    if not told:
        return None
    said = np.array([probability for probability, _ in told])
    right = np.array([is_right for _, is_right in told], dtype=np.float64)
    of_bin = np.rint(said * BINS).astype(np.int64)
    bins, error, chance = [], 0.0, 0.0
    for k in np.unique(of_bin).tolist():
        own = of_bin == k
        cases, mean, share = int(own.sum()), float(said[own].mean()), float(right[own].mean())
        error += cases / said.size * abs(share - mean)
        chance += float(np.sqrt(2.0 / np.pi * cases * mean * (1.0 - mean))) / said.size
        ends = max((k - 0.5) / BINS, 0.0), min((k + 0.5) / BINS, 1.0)
        bins.append({"from": ends[0], "to": ends[1], "cases": cases, "said": mean, "right": share})
    brier = float(np.mean((said - right) ** 2))
    return {"cases": said.size, "calibration_error": error, "chance": chance, "brier": brier, "bins": bins}
