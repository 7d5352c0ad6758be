"""Whether a probability means what it says: of the runs given p, a share p should be faults."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import beta

from wetwell.detector.evaluation.scores import ScoredRun

EDGES = (0.0, 0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99, 1.0)
LEAST_PROBABILITY = 1e-12
"""What the logarithmic score takes for 0."""


def binomial_interval(hits: int, count: int, confidence: float = 0.95) -> tuple[float, float]:
    """Exact interval of the probability of an event that was seen `hits` times in `count` (> 0).

    References
    ----------
    .. [1] C. J. Clopper, E. S. Pearson, The use of confidence or fiducial limits, Biometrika 26, 1934.

    Examples
    --------
    >>> low, high = binomial_interval(0, 10)
    >>> low, round(high, 3)
    (0.0, 0.308)
    """
    tail = (1.0 - confidence) / 2.0
    low = float(beta.ppf(tail, hits, count - hits + 1)) if hits else 0.0
    return low, float(beta.isf(tail, hits + 1, count - hits)) if hits < count else 1.0


def reliability(runs: Sequence[ScoredRun]) -> dict[str, Any] | None:
    r"""Probability of "some fault" against how often there was one; None where only 0 and 1 were given.

    Returns
    -------
    figures : dict
        `bins`: runs by probability, with the mean probability, the share of faults and its exact interval, which
        takes the runs for independent. `expected_error`: mean distance of the two, weighted by runs (0..1; best 0).
        `brier`: mean of $(p - y)^2$ (0..1; best 0). `log_score`: mean of $-\ln p_y$ (>= 0; best 0).

    References
    ----------
    .. [1] A. P. Dawid, The well-calibrated Bayesian, Journal of the American Statistical Association 77, 1982.
    """
    weighed = [run for run in runs if np.isfinite(run.fault_probability)]
    given = np.array([run.fault_probability for run in weighed])
    is_fault = np.array([run.truth != "normal" for run in weighed], dtype=np.bool_)
    if np.isin(given, (0.0, 1.0)).all():
        return None
    places = np.minimum(np.searchsorted(EDGES, given, side="right") - 1, len(EDGES) - 2)
    rows, error = [], 0.0
    for place in np.unique(places):
        held = places == place
        count, hits = int(held.sum()), int(is_fault[held].sum())
        mean = float(given[held].mean())
        error += count * abs(mean - hits / count) / len(weighed)
        rows.append(
            {
                "from": EDGES[place],
                "to": EDGES[place + 1],
                "runs": count,
                "mean_probability": mean,
                "fault_share": hits / count,
                "interval_95": list(binomial_interval(hits, count)),
            }
        )
    told = np.where(is_fault, given, 1.0 - given)
    return {
        "bins": rows,
        "expected_error": error,
        "brier": float(np.mean((given - is_fault) ** 2)),
        "log_score": float(-np.mean(np.log(np.maximum(told, LEAST_PROBABILITY)))),
    }
