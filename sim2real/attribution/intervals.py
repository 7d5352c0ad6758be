"""Intervals of fitted parameters, and the fit that other stations make likelier."""

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.sim2real.attribution.candidates import Candidate
from wetwell.sim2real.attribution.fitting import Fit, Fitter
from wetwell.sim2real.attribution.known import agreeing, known_of, narrowed
from wetwell.sim2real.likelihood.evidence import Evidence
from wetwell.sim2real.likelihood.priors import EVEN, Priors
from wetwell.sim2real.recording.regimes import REGIMES
from wetwell.sim2real.residuals.bins import Bins
from wetwell.simulator.effects import EFFECTS

TWO_SIDED = 1.96
MOST_BLOCKS = 24
"""Most blocks of neighbouring cycles: noise that is slower than a cycle stays within one."""
RISE = 10.0
"""Of the sum of squares, at the ends of an interval of a parameter that has no slope, such as a limit."""
HALF_SCAN_S = 0.5
"""Least half width of a time: a sample may stand for the begin or the end of its second."""
FORM = (0.01, 0.03)
"""Least half width, as a share of the way from neutral, where a name fixes the equation, and where it does not."""
HALVES = (1.0, 0.5, 0.25)
"""Shares of the way to an end of its range at which a parameter is tried, while the recording speaks against it."""
STRIDES = (0.005, 0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.14, 0.2, 0.28, 0.4, 0.6, 0.8)
"""Steps to such ends, as shares of the way to neutral, or of as far on the other side."""


def covariance_of(fitter: Fitter, fit: Fit, bins: Bins, slopes: Floats) -> Floats:
    r"""(parameters, parameters) covariance of fitted points, from the slopes of the rows that were fitted.

    $$\operatorname{cov} = H^{-1} \left(\sum_b g_b g_b^T + \sum_c g_c g_c^T + \sum_c t_c t_c^T\right) H^{-1},
    \qquad H = J^T J$$

    with the pulls $g = J^T r$ of blocks b of neighbouring cycles (noise, also slow noise) and of cells c, signals in
    regimes (what the model does not get right pulls differently in each), and $t = J^T \tau$ with the tolerance τ of
    a right model, which has one sign in a cell.

    References
    ----------
    .. [1] K.-Y. Liang, S. L. Zeger, Longitudinal data analysis using generalized linear models, Biometrika 1986.
    """
    rows = fitter.rows
    residuals = fit.residuals[rows]
    cycles = np.unique(bins.cycle[rows], return_inverse=True)[1]
    count = int(cycles.max(initial=0)) + 1
    block = cycles * min(MOST_BLOCKS, count) // count
    cell = np.unique(bins.signal[rows] * len(REGIMES) + bins.regime[rows], return_inverse=True)[1]
    pulls = [
        _sums(slopes * residuals[:, None], block),
        _sums(slopes * residuals[:, None], cell),
        _sums(slopes * bins.tolerance[rows, None], cell),
    ]
    inverse = np.linalg.pinv(slopes.T @ slopes)
    return np.asarray(inverse @ sum(pull.T @ pull for pull in pulls) @ inverse, dtype=np.float64)


def intervals_of(fitter: Fitter, fit: Fit, bins: Bins, priors: Priors = EVEN) -> Floats:
    """(parameters, 2) ends of 95 % intervals, as points in the ranges, in the order of the candidates.

    They are those of `covariance_of`, narrowed by what is known of parameters before.
    """
    x = fit.position
    if x.size == 0:
        return np.zeros((0, 2))
    slopes = fitter.loss_slopes(fit)[fitter.rows]
    covariance = covariance_of(fitter, fit, bins, slopes)
    known = agreeing(known_of(fit, priors), x, covariance)
    spread = TWO_SIDED * np.sqrt(np.maximum(np.diag(narrowed(covariance, known)), 0.0))
    ends = np.clip(np.column_stack([x - spread, x + spread]), 0.0, 1.0)
    for flat in np.flatnonzero(~np.any(slopes, axis=0)):
        ends[flat] = _profile(fitter, fit, x, int(flat))
    is_open = np.all(ends == (0.0, 1.0), axis=1) & np.any(slopes, axis=0)
    beside = [_beside_open(fitter, fit, covariance, slopes, int(k)) for k in np.flatnonzero(is_open)]
    if found := [its for its in beside if its is not None]:
        ends = np.column_stack([np.min(found, axis=0)[:, 0], np.max(found, axis=0)[:, 1]])
    frees = [(free, candidate) for candidate in fit.candidates for free in candidate.free]
    for k, (free, candidate) in enumerate(frees):
        form = FORM[0] if EFFECTS[candidate.name].has_one_form else FORM[1]
        value = free.value(float(x[k]))
        least = max(form * abs(value - (free.neutral or 0.0)), HALF_SCAN_S if free.unit == "s" else 0.0)
        low, high = (min(max(value + side * least, free.low), free.high) for side in (-1.0, 1.0))
        ends[k] = min(ends[k, 0], free.normalised(low)), max(ends[k, 1], free.normalised(high))
        if candidate.component == "controller" and free.unit == "m":  # its levels may all be off alike
            ends[k] += np.array([-1.0, 1.0]) * fitter.half_step_m / (free.high - free.low)
            ends[k] = np.clip(ends[k], 0.0, 1.0)
    return np.asarray(ends, dtype=np.float64)


def left_open(found: Evidence) -> Floats:
    """(parameters,) half widths of 95 % intervals by the likelihood alone, as parts of the ranges."""
    precision = found.precision + np.eye(len(found.precision))
    return np.asarray(TWO_SIDED * np.sqrt(np.diag(np.linalg.inv(precision))), dtype=np.float64)


def sharpened(fit: Fit, ends: Floats, found: Evidence) -> Floats:
    """Ends that the likelihood brings away from values at which an effect is none, or another one.

    The fit counts all bins alike: what a right level may be off in all steady seconds may be as much as a lag does
    there, though its ramps need the lag. The likelihood weighs them so, and it decided that the effect is there.
    Where two strengths may stand for each other, as of rags that slow a pump and rags that throttle it, the fit knows
    nothing of how they grow either.

    Parameters
    ----------
    fit : Fit
    ends : (parameters, 2) array
        As `intervals_of` makes them.
    found : Evidence
        Of the same fit, its candidates in the same order.
    """
    likely = _likely_ends(fit, found)
    sharp, first = ends.copy(), 0
    for candidate in fit.candidates:
        its = ends[first : first + len(candidate.free)]
        values = _values_elsewhere(candidate)
        if _may_be_neutral(candidate, its) == [True]:
            values |= {free.name: free.neutral for free in candidate.free if free.neutral is not None}
        for k, free in enumerate(candidate.free, start=first):
            if free.name in values and ends[k, 0] <= (elsewhere := free.normalised(values[free.name])) <= ends[k, 1]:
                side = int(fit.position[k] < elsewhere)
                nearest = min if side == 0 else max  # what the fit tells is in its own interval
                sharp[k, side] = nearest(likely[k, side], fit.position[k])
        first += len(candidate.free)
    return sharp


def are_sized(fit: Fit, ends: Floats, told: Collection[str]) -> bool:
    """Whether the recording says how large some effects of a fit are, and that they are none of another name.

    The interval of an only strength must not hold neutral, as that of all its range does. Those of several may: one
    may act alone, and wear by head takes the place of wear by leak. No interval may hold an end of a range at which
    the effect is another one: a pocket of air that no flow carries away is a lift.

    Parameters
    ----------
    fit : Fit
    ends : (parameters, 2) array
        As `intervals_of` makes them.
    told : names of effects
        Those that are asked of: a companion is too small to be told, and need not have a size.
    """
    parts = list(zip(fit.candidates, fit.split(ends), strict=False))  # of no candidates it is one empty part
    return all(
        _may_be_neutral(candidate, its) != [True] and not any(_may_be_another(candidate, its))
        for candidate, its in parts
        if candidate.name in told
    )


def are_named(fit: Fit, found: Evidence, told: Collection[str]) -> bool:
    """Whether some effects of a fit are none of another name, by the likelihood.

    Rags that may be there at once are wear, and tell nothing of rags.
    """
    ends = _likely_ends(fit, found)
    parts = zip(fit.candidates, fit.split(ends), strict=False)  # of no candidates it is one empty part
    return not any(any(_may_be_another(one, its)) for one, its in parts if one.name in told)


def _likely_ends(fit: Fit, found: Evidence) -> Floats:
    """(parameters, 2) ends of 95 % intervals by the likelihood alone."""
    x, spread = fit.position + found.step, left_open(found)
    return np.asarray(np.clip(np.column_stack([x - spread, x + spread]), 0.0, 1.0), dtype=np.float64)


def _may_be_neutral(candidate: Candidate, ends: Floats) -> list[bool]:
    """Of each strength."""
    return _hold(candidate, ends, {free.name: free.neutral for free in candidate.free})


def _may_be_another(candidate: Candidate, ends: Floats) -> list[bool]:
    """Of each parameter with an end of its range at which it is another effect."""
    return _hold(candidate, ends, _values_elsewhere(candidate))


def _values_elsewhere(candidate: Candidate) -> dict[str, float]:
    """Ends of ranges at which an effect is another one, by the names of the parameters."""
    of_name = {free.name: {"low": free.low, "high": free.high} for free in candidate.free}
    return {name: of_name[name][end] for name, end in EFFECTS[candidate.name].another_at.items() if name in of_name}


def _hold(candidate: Candidate, ends: Floats, values: Mapping[str, float | None]) -> list[bool]:
    """Of each parameter for which there is a value, whether its interval holds that."""
    return [
        bool(low <= free.normalised(value) <= high)
        for free, (low, high) in zip(candidate.free, ends, strict=True)
        if (value := values.get(free.name)) is not None
    ]


def _beside_open(fitter: Fitter, fit: Fit, covariance: Floats, slopes: Floats, parameter: int) -> Floats | None:
    """(parameters, 2) ends of what the others may be while one has any value of its range; None where it may not.

    At the fit, and fitted again near the ends of that range, each as far as it may be off with the one held. What
    the slopes say of all at once goes far beyond the range: a friction at one duty is known, its exponent is not.
    """
    variance = covariance[parameter, parameter]
    alone = np.diag(covariance) - covariance[parameter] ** 2 / variance
    spread = TWO_SIDED * np.sqrt(np.maximum(alone, 0.0))
    rise = TWO_SIDED**2 * variance / np.linalg.pinv(slopes.T @ slopes)[parameter, parameter]
    points = _elsewhere(fitter, fit, parameter, float(rise))
    if not points:
        return None
    points.append(fit.position)
    ends = np.column_stack([np.min(points, axis=0) - spread, np.max(points, axis=0) + spread])
    ends[parameter] = 0.0, 1.0
    return np.asarray(np.clip(ends, 0.0, 1.0), dtype=np.float64)


def _elsewhere(fitter: Fitter, fit: Fit, parameter: int, rise: float) -> list[Floats]:
    """(parameters,) points of all, fitted again with one of them held near either end of its range.

    Straight lines from the fit do not reach so far: an area at the floor goes with the exponent of the walls. A
    recording speaks against a point by a rise of the sum of squares.
    """
    here, limit, found = float(fit.position[parameter]), fitter.cost(fit) + rise, []
    for end in (0.0, 1.0):
        for share in HALVES:
            at = here + share * (end - here)
            held = _held(fitter, fit, parameter, at)
            if held is not None and fitter.cost(held) < limit:
                found.append(np.insert(held.position, parameter, at))
                break
    return found


def _held(fitter: Fitter, fit: Fit, parameter: int, at: float) -> Fit | None:
    """The fit with one of its parameters held at a point, the others refined; None where that cannot work."""
    candidates, points, first = [], [], 0
    for candidate, point in zip(fit.candidates, fit.points, strict=True):
        k = parameter - first
        is_its = 0 <= k < point.size
        candidates.append(_fixed(candidate, k, at) if is_its else candidate)
        points.append(np.delete(point, k) if is_its else point)
        first += point.size
    begun = fitter.at(candidates, points)
    return None if begun is None else fitter.refine(begun)


def _fixed(candidate: Candidate, parameter: int, at: float) -> Candidate:
    free = candidate.free[parameter]
    return replace(
        candidate,
        fixed=(*candidate.fixed, (free.name, free.value(at))),
        free=(*candidate.free[:parameter], *candidate.free[parameter + 1 :]),
    )


def _sums(values: Floats, group: Integers) -> Floats:
    """(groups, parameters) sums of rows."""
    return np.array([np.bincount(group, column) for column in values.T]).T


def _profile(fitter: Fitter, fit: Fit, x: Floats, parameter: int) -> tuple[float, float]:
    """Ends on both sides from which on the sum of squares has risen by `RISE`, the other parameters kept."""
    free = [free for candidate in fit.candidates for free in candidate.free][parameter]
    neutral = 0.0 if free.neutral is None else free.normalised(free.neutral)
    limit = fitter.cost(fit) + RISE
    ends = []
    for side in (-1.0, 1.0):
        moved = x.copy()
        for stride in STRIDES:
            moved[parameter] = np.clip(x[parameter] + side * stride * (x[parameter] - neutral), 0.0, 1.0)
            if fitter.cost(fitter.at(fit.candidates, fit.split(moved))) > limit:
                break
        else:
            if side > 0.0:  # away from neutral nothing speaks against it
                moved[parameter] = float(x[parameter] > neutral)
        ends.append(float(moved[parameter]))
    return min(ends), max(ends)


def informed(fitter: Fitter, fit: Fit, priors: Priors) -> Fit:
    r"""The most probable fit under a normal prior of its parameters.

    $$x' = x + C' P (m - x), \qquad C' = (I + C P)^{-1} C$$

    with the points x of the fit, their covariance C as of `covariance_of`, and mean m and precision P of the prior,
    but for parameters that contradict it.

    Parameters
    ----------
    fitter : Fitter
    fit : Fit
    priors : Priors
        Without one for its parameters the fit stays as it is.
    """
    known, x = known_of(fit, priors), fit.position
    if not known.precision.any():
        return fit
    covariance = covariance_of(fitter, fit, fitter.bins, fitter.loss_slopes(fit)[fitter.rows])
    known = agreeing(known, x, covariance)
    step = narrowed(covariance, known) @ (known.precision * (known.mean - x))
    moved = fitter.at(fit.candidates, fit.split(np.clip(x + step, 0.0, 1.0)))
    return fit if moved is None else moved
