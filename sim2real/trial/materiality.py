"""Whether what a truth deviates in matters: how far it moves the readings, in sizes on which nobody acts."""

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.sim2real.trial.readings import Readings

_SHARES = (np.arange(200) + 0.5) / 200.0


def moved(truth: Readings, twin: Readings) -> float:
    r"""Largest difference of a group between a truth and its twin without a deviation, over what is material.

    $$\max_g \frac{W_1(x_g, x'_g)}{\overline{m}'_g + W_1(x'_{g,\text{odd}}, x'_{g,\text{even}})}$$

    with the mean absolute difference of quantiles $W_1$ of the seconds of a group, those of the twin x', their mean
    material size m', and how far its odd turns differ from its even ones: pumps of truth and twin do not start in the
    same seconds, so that one meets another moment of the same weather. Over 1 it matters.

    Parameters
    ----------
    truth, twin : Readings
        Groups that do not come at least twice in both tell nothing.

    References
    ----------
    .. [1] C. Villani, Optimal Transport: Old and New, 2009: the distance W₁.

    Examples
    --------
    >>> def flows(offset_m3h):
    ...     values = offset_m3h + np.array([10.0, 12.0, 10.0, 12.0])
    ...     turn = np.array([1, 1, 2, 2])
    ...     return Readings(group=np.zeros(4, dtype=int), value=values, material=np.ones(4), turn=turn)
    >>> moved(flows(0.0), flows(0.0)), moved(flows(3.0), flows(0.0))
    (0.0, 3.0)
    """
    ours, theirs = _by_group(truth), _by_group(twin)
    most = 0.0
    for group in ours.keys() & theirs.keys():
        values, others = truth.value[ours[group]], twin.value[theirs[group]]
        is_odd = twin.turn[theirs[group]] % 2 == 1
        if np.ptp(truth.turn[ours[group]]) == 0 or is_odd.all() or not is_odd.any():
            continue
        allowed = float(np.mean(twin.material[theirs[group]])) + _distance(others[is_odd], others[~is_odd])
        most = max(most, _distance(values, others) / allowed)
    return most


def _by_group(readings: Readings) -> dict[int, Integers]:
    """Rows of each group, smallest value first."""
    order = np.lexsort((readings.value, readings.group))
    groups, first = np.unique(readings.group[order], return_index=True)
    return dict(zip(groups.tolist(), np.split(order, first[1:]), strict=True))


def _distance(values: Floats, others: Floats) -> float:
    """Mean absolute difference of the quantiles of two samples, each in order."""
    picked = [sample[(_SHARES * sample.size).astype(np.int64)] for sample in (values, others)]
    return float(np.mean(np.abs(picked[0] - picked[1])))
