"""Whether each effect of a set is there, and what of it the others could do."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import lsq_linear
from scipy.special import gammaincinv

from wetwell.protocols.arrays import Flags, Floats
from wetwell.sim2real.attribution.fitting import Fit
from wetwell.sim2real.likelihood.cells import Cells
from wetwell.sim2real.likelihood.covariance import LATE
from wetwell.sim2real.likelihood.evidence import Evidence

SURE = 0.95
"""Probability with which the recording must be likelier with an effect than without it."""
GONE_ON = 3
"""Steps that others may take to do an effect's work: slopes do not hold for all of the way."""
PART_LEFT = 0.25
"""Share of the square of an effect's work that slopes may leave where the simulator is asked for what is left: all
others are spared the time that it takes. [1]"""


def are_needed(found: Evidence, strengths: Sequence[int]) -> Flags:
    r"""Whether the recording needs each effect of a set: whether it can be neutral is asked of the simulator.

    $$2 \ln \frac{p(z \mid \hat x)}{p(z \mid \hat x_{-i},\ \text{without } i)} > \chi^2_{.95}$$

    under the same errors, all parameters of the other effects at their best. A limit has no slope at its place, and a
    deadband a different one at each: no straight line leads from them to neutral.

    Parameters
    ----------
    found : Evidence
    strengths : sequence of int
        How many strengths each effect has: the degrees of freedom of χ².

    Returns
    -------
    is_needed : (effects,) array
    """
    quantiles = 2.0 * gammaincinv(np.maximum(strengths, 1) / 2.0, SURE)  # scipy.stats would take .3 s to load
    return np.asarray(found.needed > quantiles, dtype=np.bool_)


def strengths_of(fit: Fit) -> list[dict[int, float]]:
    """Of each effect the way from each of its strengths, by number, to neutral, over its range."""
    found, first, position = [], 0, fit.position
    for candidate in fit.candidates:
        found.append(
            {
                first + k: free.normalised(free.neutral) - float(position[first + k])
                for k, free in enumerate(candidate.free)
                if free.neutral is not None
            }
        )
        first += len(candidate.free)
    return found


def own_signature(signature: Floats, others: Floats, allowed: Floats, room: tuple[Floats, Floats]) -> Floats:
    r"""What of an effect's signature is left once the others of its set are fitted in its place.

    $$f + J \hat x, \qquad \hat x = \arg\min_x \sum_i \left(\frac{f_i + (J x)_i}{a_i}\right)^2,
    \qquad l \le x \le u$$

    A friction that is too high beside a lift that is too low may do next to nothing, though each does much. No other
    goes beyond its range: a leak that would have to flow backwards does nobody's work.

    Parameters
    ----------
    signature : (cells,) array
        f, what the effect explains.
    others : (cells, parameters) array
        J, change of the residuals with each parameter of the others.
    allowed : (cells,) array
        a, size under which a difference is none.
    room : (parameters,) array, (parameters,) array
        l and u, how far the others may go down and up.
    """
    return np.asarray(signature + others @ _instead(signature, others, allowed, room), dtype=np.float64)


def could_others(
    signature: Floats,
    others: Floats,
    position: Floats,
    allowed: Floats,
    is_within: Callable[[Floats], bool],
    left_of: Callable[[Floats], Floats | None],
) -> bool:
    """Whether the others of a set could do all of an effect's work, but for what is allowed.

    Their slopes say how far they would have to go, and the simulator what they do there: a short lag goes like a
    delay, and a long one does not.

    Parameters
    ----------
    signature, others, allowed
        As of `own_signature`.
    position : (parameters,) array
        Of the others, 0 to 1.
    is_within : callable
        Whether what is left is what is allowed, or less.
    left_of : callable
        What the simulator leaves without the effect, the others at a position; None where they cannot be there.
    """
    left, most = signature, PART_LEFT * float(np.sum((signature / allowed) ** 2))
    for _ in range(GONE_ON):
        change = _instead(left, others, allowed, (-position, 1.0 - position))
        promised = left + others @ change
        if not is_within(promised) and np.sum((promised / allowed) ** 2) > most:
            return False
        position = np.clip(position + change, 0.0, 1.0)
        replayed = left_of(position)
        if replayed is None or is_within(replayed):
            return replayed is not None
        left = replayed
    return False


def _instead(signature: Floats, others: Floats, allowed: Floats, room: tuple[Floats, Floats]) -> Floats:
    """(parameters,) x̂ of `own_signature`: how far the others go to do an effect's work, by their slopes."""
    if others.shape[1] == 0:
        return np.zeros(0)
    directions, inner = np.linalg.qr(others / allowed[:, None])
    return np.asarray(lsq_linear(inner, -directions.T @ (signature / allowed), room).x, dtype=np.float64)


def unshifted(cells: Cells, signature: Floats, late: Floats) -> Floats:
    r"""What of an effect's signature is left once the others come early or late in its place, in each block.

    $$f - \hat x t, \qquad \hat x = \arg\min_x \sum_i \left(\frac{f_i - x t_i}{a_i}\right)^2 + x^2$$

    Parameters
    ----------
    cells : Cells
    signature : (cells,) array
        f, what the effect explains.
    late : (cells,) array
        t, change of what the others explain within the time by which they may be early or late.
    """
    left = signature.copy()
    for block in cells.blocks:
        shift = late[block.rows] / block.allowed
        along = float(shift @ (signature[block.rows] / block.allowed)) / (LATE[0] ** -2 + float(shift @ shift))
        left[block.rows] -= along * late[block.rows]
    return left


def time_constant_s(fit: Fit, member: int) -> float:
    """Seconds of the longest strength of an effect that is a time, such as a lag; 0 without any."""
    return max(_times_s(fit, member), default=0.0)


def is_only_late(fit: Fit, member: int, time_s: float) -> bool:
    """Whether an effect only lets something come late, by a time that is not material."""
    times = _times_s(fit, member)
    strengths = sum(free.neutral is not None for free in fit.candidates[member].free)
    return 0 < strengths == len(times) and max(times) <= time_s


def _times_s(fit: Fit, member: int) -> list[float]:
    candidate, point = fit.candidates[member], fit.points[member]
    return [
        abs(free.value(float(one)) - free.neutral)
        for free, one in zip(candidate.free, point, strict=True)
        if free.unit == "s" and free.neutral is not None
    ]
