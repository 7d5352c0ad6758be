"""Nested F-test: whether a model needs more parameters than its null model."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from wetwell.detector.statistics.f_distribution import log_f_survival
from wetwell.protocols.arrays import Floats

RANK_TOLERANCE: Final = 1e-11
"""A column counts as a parameter if this share of its length, or more, is independent of the columns before it."""

_EPS: Final = float(np.finfo(float).eps)
_TINY: Final = float(np.finfo(float).tiny)


@dataclass(frozen=True, slots=True, kw_only=True)
class FTest:
    """Outcome of a nested F-test.

    `f` is the ratio, `log_p` the natural logarithm of its p-value, `aic_null` and `aic_alternative` the information
    criteria of the two models (the smaller is the better one), `samples` how many points went in.
    """

    f: float
    log_p: float
    aic_null: float
    aic_alternative: float
    samples: int


def _triangle(table: Floats, null_columns: int) -> tuple[Floats, int]:
    """Triangular factor of [null, extra, response] without the dependent columns, and how many null ones are left."""
    while True:
        triangle: Floats = np.asarray(np.linalg.qr(table, mode="r"))  # NumPy's stubs say (Q, R) for every mode
        squares = triangle * triangle
        dependent = squares.diagonal()[:-1] <= RANK_TOLERANCE**2 * squares.sum(axis=0)[:-1]
        if not dependent.any():
            return triangle, null_columns
        first = int(dependent.argmax())
        table = np.delete(table, first, axis=1)
        null_columns -= first < null_columns


def compare(table: Floats, null_columns: int) -> FTest:
    """F-test on the columns [null, extra, response] of a finite (m, p + 1) table, the first of them the null ones.

    Raises
    ------
    ValueError
        If there are not more samples than parameters.
    """
    samples = table.shape[0]
    if samples < table.shape[1]:
        raise ValueError(f"samples must exceed the {table.shape[1] - 1} parameters of the alternative, got {samples}")
    triangle, null_parameters = _triangle(table, null_columns)
    parameters = triangle.shape[1] - 1
    response = triangle[:, -1]
    resolution = max((samples * _EPS) ** 2 * float(response @ response), _TINY)
    explained = float(response[null_parameters:-1] @ response[null_parameters:-1])
    if explained <= resolution:
        explained = 0.0
    rest = max(float(response[-1]) ** 2, resolution)
    added, free = parameters - null_parameters, samples - parameters
    f = (explained / added) / (rest / free) if added else 0.0
    return FTest(
        f=f,
        log_p=log_f_survival(f, added, free),
        aic_null=samples * math.log((rest + explained) / samples) + 2 * null_parameters,
        aic_alternative=samples * math.log(rest / samples) + 2 * parameters,
        samples=samples,
    )


def nested_f_test(null_design: npt.ArrayLike, extra_design: npt.ArrayLike, response: npt.ArrayLike) -> FTest:
    r"""Nested F-test: whether the response needs extra columns beside those of the null model.

    $$F = \frac{(SSR_0 - SSR_1) / (p_1 - p_0)}{SSR_1 / (m - p_1)}, \qquad AIC = m \ln(SSR / m) + 2 p$$

    One QR factorisation of [null, extra, response] gives both sums of squares, and their difference without
    cancellation; the scale of a column does not matter. A column that depends on those before it is left out and
    does not count in p. If no extra column is left, F = 0 and log p = 0. A sum of squares below the rounding of the
    response counts as that rounding, so that a perfect fit gives finite numbers: F = 0 if the null model already
    fits perfectly, huge if only the alternative does.

    Parameters
    ----------
    null_design, extra_design : (m, p0) and (m, p1 - p0) arrays
        Columns of the null model, the constant one included, and columns that only the alternative has.
    response : (m,) array
        Values to explain.

    Raises
    ------
    ValueError
        If a value is not finite, shapes disagree or there are not more samples than columns.

    References
    ----------
    .. [1] N. R. Draper, H. Smith, Applied Regression Analysis, 3rd edition, Wiley 1998 (extra sum of squares).
    .. [2] H. Akaike, A new look at the statistical model identification, IEEE Trans. Automatic Control 19, 1974.

    Examples
    --------
    >>> test = nested_f_test(np.ones((4, 1)), [[0.0], [1.0], [2.0], [3.0]], [0.0, 1.0, 1.0, 2.0])
    >>> round(test.f, 9), round(math.exp(test.log_p), 6), test.samples
    (18.0, 0.051317, 4)
    """
    null, extra, y = (np.asarray(value, dtype=float) for value in (null_design, extra_design, response))
    if null.ndim != 2 or extra.ndim != 2 or y.shape != (null.shape[0],) or extra.shape[0] != null.shape[0]:
        raise ValueError(
            "null_design (m, p0), extra_design (m, p) and response (m,) must agree in m, "
            f"got shapes {null.shape}, {extra.shape} and {y.shape}"
        )
    table = np.column_stack([null, extra, y])
    if not np.isfinite(table).all():
        raise ValueError("null_design, extra_design and response must be finite, got NaN or infinity")
    return compare(table, null.shape[1])
