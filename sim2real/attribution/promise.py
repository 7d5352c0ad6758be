"""What a further effect promises beside others, as if what each does alone were added: no replay is needed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.attribution.candidates import Candidate
from wetwell.sim2real.likelihood.evidence import Weights

MOST_SCALED = 2.0
"""Times what an effect did alone that it may do beside others: the starts of a grid are further apart. [1]"""
MOST_COLUMNS = 24
"""That are weighed together: the products of what candidates do with each other are of no use."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Alone:
    """What a candidate does at some points: alone, or beside others where it was replayed.

    Attributes
    ----------
    candidate : Candidate
    points : tuple of (parameters,) array
    changes : (points, cells) array
        Of the residuals.
    """

    candidate: Candidate
    points: tuple[Floats, ...]
    changes: Floats

    @property
    def most_scaled(self) -> Floats:
        """(points,) times what it did that it may do beside others.

        Alone a grid is left where it leads away, at a hundredth of the range: a friction under a meter that reads
        low. Beside others it may lead far, so the strongest start in each direction goes to the end of its range.
        """
        points = np.array(self.points)
        neutral = np.array([self.candidate.neutral(point) for point in self.points])
        away = points - neutral
        room = np.where(away > 0.0, 1.0 - neutral, -neutral)
        ends = np.divide(room, away, out=np.full_like(away, np.inf), where=away != 0.0).min(axis=1, initial=np.inf)
        strongest: dict[bytes, int] = {}
        for k in np.argsort(np.sum(away**2, axis=1)).tolist():
            strongest[np.where(away[k] == 0.0, points[k], np.sign(away[k]) + 2.0).tobytes()] = k
        most = np.full(len(points), MOST_SCALED)
        if not self.candidate.is_limit:
            far = [k for k in strongest.values() if np.isfinite(ends[k])]
            most[far] = np.maximum(MOST_SCALED, ends[far])
        return most

    def like(self, other: "Alone", weights: Weights) -> float:
        r"""Share of what a candidate does that another one does too, at the points where they are most alike.

        $$\max_{i, j} \frac{(d_i^T C^{-1} e_j)^2}{d_i^T C^{-1} d_i \; e_j^T C^{-1} e_j}$$
        """
        products = weights.products(np.vstack([self.changes, other.changes]).T)
        squares, own = np.diag(products), len(self.changes)
        both = np.outer(squares[:own], squares[own:])
        share = np.divide(products[:own, own:] ** 2, both, out=np.zeros_like(both), where=both > 0.0)
        return float(share.max(initial=0.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Promise:
    """A point at which a candidate may do well beside others, and the drop of the weighed squares."""

    candidate: Candidate
    point: Floats
    gain: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Beside:
    """What further effects come beside.

    Attributes
    ----------
    weights : Weights
    residuals : (cells,) array
    slopes : (cells, parameters) array
        Change of the residuals with each parameter of the others, over its range; no columns where the others stay.
    position : (parameters,) array
        Of the others.
    lacks : float
        By how much the likeliest set is likelier, in the logarithm.
    """

    weights: Weights
    residuals: Floats
    slopes: Floats
    position: Floats
    lacks: float = 0.0

    @property
    def still(self) -> "Beside":
        """The same, with the others as they stand."""
        return replace(self, slopes=self.slopes[:, :0], position=self.position[:0])

    def promises(self, alones: Sequence[Alone]) -> list[list[Promise]]:
        r"""Of each candidate what it makes likelier, its strength and the others' parameters fitted again.

        $$\max_{\alpha, \beta} r^T C^{-1} r - (r + \alpha d + S \beta)^T C^{-1} (r + \alpha d + S \beta),
        \qquad 0 \le \alpha \le 2$$

        with r the residuals, d what the candidate changes alone, S the slopes of the others, and the covariance C of
        the cells by what the others leave: what is explained by an error of their form promises little. The others
        stay within their ranges. Of points that differ in strength alone there is the best one, the best form first.
        What the values themselves show of a pattern is as strong as they show it: α is 1.
        """
        found: list[list[Promise]] = []
        few: list[Alone] = []
        for one in alones:
            if few and sum(len(each.points) for each in few) + len(one.points) > MOST_COLUMNS:
                found += self._of_few(few)
                few = []
            few.append(one)
        return found + (self._of_few(few) if few else [])

    def _of_few(self, alones: Sequence[Alone]) -> list[list[Promise]]:
        columns = np.column_stack([self.residuals, self.slopes, *(one.changes.T for one in alones)])
        squares, directions = np.linalg.eigh(self.weights.products(columns))
        root = np.sqrt(np.maximum(squares, 0.0))[:, None] * directions.T
        count = self.slopes.shape[1]
        left, slopes, changed = root[:, 0], root[:, 1 : 1 + count], root[:, 1 + count :].T
        basis, triangle = np.linalg.qr(slopes)
        ends = np.cumsum([len(one.points) for one in alones])[:-1]
        return [
            self._of(one, its, left, basis, triangle)
            for one, its in zip(alones, np.split(changed, ends), strict=True)
        ]

    def _of(self, alone: Alone, changed: Floats, left: Floats, basis: Floats, triangle: Floats) -> list[Promise]:
        """Promises of one candidate, by columns that were made independent."""
        along_others = changed @ basis
        apart = changed - along_others @ basis.T
        along, squares = apart @ left, np.maximum(np.sum(apart**2, axis=1), np.finfo(float).tiny)
        is_strength = np.array([free.neutral is not None for free in alone.candidate.free], dtype=bool)
        is_scaled = is_strength.any() and not alone.candidate.is_pattern
        scale = np.clip(-along / squares, 0.0, alone.most_scaled) if is_scaled else np.ones(along.size)
        best: dict[bytes, int] = {}
        for place in np.argsort(scale * (2.0 * along + scale * squares)).tolist():
            best.setdefault(alone.points[place][~is_strength].tobytes(), place)
        found = []
        for place in best.values():
            strength = float(scale[place])
            wanted = basis.T @ left + strength * along_others[place]
            moved = _bounded(triangle, wanted, -self.position, 1.0 - self.position)
            after = left + strength * changed[place] + basis @ (triangle @ moved)
            point = _scaled(alone.candidate, alone.points[place], strength)
            gain = float(left @ left - after @ after)
            found.append(Promise(candidate=alone.candidate, point=point, gain=gain))
        return sorted(found, key=lambda one: -one.gain)


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
    neutral = candidate.neutral(point)
    return np.clip(neutral + scale * (point - neutral), 0.0, 1.0)
