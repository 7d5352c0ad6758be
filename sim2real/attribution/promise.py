"""What a further effect promises beside others, as if what each does alone were added: no replay is needed."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.attribution.candidates import Candidate
from wetwell.sim2real.residuals.asinh_loss import asinh_loss, residuals_of, weights_of

MOST_SCALED = 2.0
"""Times what an effect did alone that it may do beside others: the starts of a grid are further apart. [1]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Alone:
    """What a candidate does at some points: alone, or beside others where it was replayed.

    Attributes
    ----------
    candidate : Candidate
    points : tuple of (parameters,) array
    changes : (points, fitted bins) array
        Of the residuals themselves, in units of noise.
    """

    candidate: Candidate
    points: tuple[Floats, ...]
    changes: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Promise:
    """A point at which a candidate may do well beside others, and the sum of squares that would be left."""

    candidate: Candidate
    point: Floats
    cost: float


@dataclass(frozen=True, kw_only=True)
class Beside:
    """What further effects come beside.

    Attributes
    ----------
    losses : (fitted bins,) array
        As `asinh_loss` makes them.
    slopes : (fitted bins, parameters) array
        Change of the residuals with each parameter of the others, over its range; no columns where the others stay.
    position : (parameters,) array
        Of the others.
    """

    losses: Floats
    slopes: Floats
    position: Floats

    def promise(self, alone: Alone) -> Promise:
        r"""What is left by the best of a candidate's points, its strength and the others' parameters fitted again.

        $$\min_{\alpha, \beta} \sum_i w_i (r_i + \alpha d_i + S_i \beta)^2, \qquad
        w = \frac{\ell(r)\,\ell'(r)}{r}, \qquad 0 \le \alpha \le 2$$

        with r the residuals, d what the candidate changes alone, S the slopes of the others, and ℓ the loss. The
        others stay within their ranges.
        """
        residuals = residuals_of(self.losses)
        root = np.sqrt(weights_of(residuals))
        basis, triangle = np.linalg.qr(root[:, None] * self.slopes)
        left = root * residuals
        changed = root * alone.changes
        along_others = changed @ basis
        apart = changed - along_others @ basis.T
        along, squares = apart @ left, np.maximum(np.sum(apart**2, axis=1), np.finfo(float).tiny)
        has_strength = any(free.neutral is not None for free in alone.candidate.free)
        scale = np.clip(-along / squares, 0.0, MOST_SCALED) if has_strength else np.ones(along.size)
        best = int(np.argmin(scale * (2.0 * along + scale * squares)))
        strength = float(scale[best])
        wanted = basis.T @ left + strength * along_others[best]
        moved = _bounded(triangle, wanted, -self.position, 1.0 - self.position)
        after = residuals + strength * alone.changes[best] + self.slopes @ moved
        return Promise(
            candidate=alone.candidate,
            point=_scaled(alone.candidate, alone.points[best], strength),
            cost=float(np.sum(asinh_loss(after) ** 2)),
        )


def _bounded(triangle: Floats, wanted: Floats, low: Floats, high: Floats) -> Floats:
    """Moves within the ranges that take most of what is wanted away.

    Two that do nearly the same, such as a friction and its exponent, go far against each other: cut one by one they
    would do anything.
    """
    moved = np.linalg.lstsq(triangle, -wanted, rcond=None)[0]
    if np.all((low <= moved) & (moved <= high)):
        return np.asarray(moved, dtype=np.float64)
    return np.asarray(lsq_linear(triangle, -wanted, (low, high)).x, dtype=np.float64)


def _scaled(candidate: Candidate, point: Floats, scale: float) -> Floats:
    """A point with its strengths so many times as far from neutral, within the range."""
    neutral = np.array(
        [
            one if free.neutral is None else free.normalised(free.neutral)
            for free, one in zip(candidate.free, point, strict=True)
        ]
    )
    is_strength = np.array([free.neutral is not None for free in candidate.free])
    return np.where(is_strength, np.clip(neutral + scale * (point - neutral), 0.0, 1.0), point)
