"""Which term, going with what, explains the residuals best: a sparse regression under the likelihood's covariance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.sim2real.correction.dictionary import Atom
from wetwell.sim2real.correction.means import Means
from wetwell.sim2real.correction.target import Target

TEMPER = 0.3
"""Power of the likelihood, and of nothing else: its cells are not as independent as `Means` takes them to be. [1]"""
SIZE_PRIOR = 0.3
"""Standard deviation of the size of an addend before anything is seen, as a share of its term. [1]"""
MOST_PARTS = 3
PROPOSED = 3
"""Terms that are tried in the simulator, the most probable first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """A term, of all pumps or mains or of one, with its addends.

    Attributes
    ----------
    target : Target
    atoms : tuple of Atom
    sizes : (columns,) array
        The offset, then those of the columns of each atom. [1]
    log : float
        Logarithm of its probability over that of no correction.
    """

    target: Target
    atoms: tuple[Atom, ...]
    sizes: Floats
    log: float

    @property
    def log_prior(self) -> float:
        """Logarithm of its probability before anything is seen."""
        return self.target.log_prior + sum(atom.log_prior for atom in self.atoms)

    def columns(self, bins: int) -> Floats:
        """(bins, columns) what each size goes with: 1 of the offset, then the shapes of the atoms. [1]."""
        return np.column_stack([np.ones(bins), *(atom.columns for atom in self.atoms)])


class Gram:
    r"""Products of columns under the inverse of the covariance of the cells, and what follows for some of them.

    $$\Delta \ln L = \tfrac12 g^T (G + 1/\tau^2)^{-1} g - \tfrac12 \ln\det(1 + \tau^2 G), \qquad
    G = T A^T C^{-1} A, \quad g = -T A^T C^{-1} r$$

    with `TEMPER` T and a prior of the sizes that is normal around 0 with `SIZE_PRIOR` τ.

    Parameters
    ----------
    products : (1 + k, 1 + k) array
        Of the means of the residuals, and of their changes with the size of each addend, under the inverse of C.

    Attributes
    ----------
    nothing : float
        Logarithm of the evidence of no correction, but for a constant.

    References
    ----------
    .. [1] D. J. C. MacKay, Bayesian interpolation, Neural Computation 4, 1992.
    """

    def __init__(self, products: Floats) -> None:
        self._products = TEMPER * products
        self.nothing = -0.5 * float(self._products[0, 0])

    def gain(self, chosen: Sequence[int] | Integers, base: Floats | None = None) -> tuple[float, Floats]:
        """Logarithm of the evidence, but for the same constant, and the best sizes.

        Parameters
        ----------
        chosen : sequence of int
            Columns that act.
        base : (columns,) array, optional
            Sizes at which the residuals are; 0 by default.
        """
        rows = np.asarray(chosen, dtype=np.int64) + 1
        start = np.zeros(rows.size) if base is None else base
        inner, slope = self._products[np.ix_(rows, rows)], self._products[rows, 0]
        pull = slope + start / SIZE_PRIOR**2
        step = -np.linalg.solve(inner + np.eye(rows.size) / SIZE_PRIOR**2, pull)
        occam = float(np.linalg.slogdet(np.eye(rows.size) + SIZE_PRIOR**2 * inner)[1])
        log = self.nothing - 0.5 * (float(pull @ step) + float(start @ start) / SIZE_PRIOR**2 + occam)
        return log, start + step

    def at(self, sizes: Floats) -> float:
        """Logarithm of the evidence, but for the same constant, of residuals that are those at the sizes."""
        inner = self._products[1:, 1:]
        occam = float(np.linalg.slogdet(np.eye(sizes.size) + SIZE_PRIOR**2 * inner)[1])
        return self.nothing - 0.5 * (float(sizes @ sizes) / SIZE_PRIOR**2 + occam)

    def covariance(self, chosen: Sequence[int] | Integers) -> Floats:
        """(columns, columns) covariance of the sizes."""
        rows = np.asarray(chosen, dtype=np.int64) + 1
        inner = self._products[np.ix_(rows, rows)]
        return np.asarray(np.linalg.inv(inner + np.eye(rows.size) / SIZE_PRIOR**2))


class Addends:
    """What may be added, and what it does to the cells as a correction of a target.

    Parameters
    ----------
    means : Means
    atoms : sequence of Atom

    Attributes
    ----------
    of_atom : dict of int to list of int
        Columns of each atom by its number; that of the offset is of -1.
    """

    def __init__(self, means: Means, atoms: Sequence[Atom]) -> None:
        self.means, self.atoms = means, tuple(atoms)
        shapes = [np.ones((means.of_bin.size, 1)), *(atom.columns for atom in atoms)]
        self._shapes = np.hstack(shapes)
        self._kept: dict[Target, tuple[Floats, Floats]] = {}
        ends = np.cumsum([0, *(one.shape[1] for one in shapes)]).tolist()
        self.of_atom = {number: list(range(*its)) for number, its in enumerate(pairwise(ends), start=-1)}

    def gram(self, target: Target, slope: Floats, left: Floats) -> Gram:
        """Of all addends of a target; what does not hang on the residuals is kept.

        Parameters
        ----------
        target : Target
        slope : (bins,) array
            Change of the residuals with a constant correction of it; what a correction that varies does is taken to
            be its product with that.
        left : (cells, 1) array
            Means of the residuals.
        """
        if target not in self._kept:
            responses = self.means.of(self._shapes, slope)
            weighed = self.means.weighed(responses)
            self._kept[target] = weighed, responses.T @ weighed
        weighed, inner = self._kept[target]
        along = weighed.T @ left
        return Gram(np.block([[self.means.products(left), along.T], [along, inner]]))


def proposals(addends: Addends, residuals: Floats, slopes: Mapping[Target, Floats]) -> list[Proposal]:
    """The best addends of each target, and the best of each smaller number; the most probable proposal first.

    Parameters
    ----------
    addends : Addends
    residuals : (bins,) array
    slopes : mapping of (bins,) arrays
        Change of the residuals with a constant correction of each target.
    """
    left = addends.means.of(residuals[:, None])
    paths = (
        _path(target, addends.gram(target, slope, left), addends.atoms, addends.of_atom)
        for target, slope in slopes.items()
    )
    return sorted(chain.from_iterable(paths), key=lambda one: -one.log)


def _path(target: Target, gram: Gram, atoms: Sequence[Atom], of_atom: Mapping[int, list[int]]) -> list[Proposal]:
    """The best addends by their number: one more as long as that pays, and each exchanged for a better one."""

    def weighed(numbers: tuple[int, ...]) -> Proposal:
        log, sizes = gram.gain([k for number in (-1, *numbers) for k in of_atom[number]])
        found = Proposal(target=target, atoms=tuple(atoms[number] for number in numbers), sizes=sizes, log=0.0)
        return replace(found, log=log - gram.nothing + found.log_prior)

    best: list[tuple[Proposal, tuple[int, ...]]] = [(weighed(()), ())]
    while len(best) <= MOST_PARTS:
        before, chosen = best[-1]
        others = [number for number in range(len(atoms)) if number not in chosen]
        tried = [(*chosen, number) for number in others]
        top = max(((weighed(numbers), numbers) for numbers in tried), key=lambda pair: pair[0].log, default=None)
        if top is None or top[0].log <= before.log:
            break
        exchanged = [
            tuple(number if one == gone else one for one in top[1])
            for gone in top[1][:-1]
            for number in range(len(atoms))
            if number not in top[1]
        ]
        best.append(max([top, *((weighed(numbers), numbers) for numbers in exchanged)], key=lambda pair: pair[0].log))
    return [proposal for proposal, _ in best]
