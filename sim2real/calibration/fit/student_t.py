"""Student's t: weights of values far out, and widths of a noise that is wider on one side, as rags only take flow."""

import numpy as np

from wetwell.protocols.arrays import Floats

DEGREES = 4.0
"""Degrees of freedom of Student's t, by which the weight of a value falls with its distance. [1]

After K. L. Lange, R. J. A. Little and J. M. G. Taylor (1989), Robust statistical modeling using the t distribution,
Journal of the American Statistical Association 84, who found 4 to serve data with a few per cent of outliers."""
ALIKE_VALUES = 5.0
"""Values that the belief in a noise as wide on both sides is worth. [1]

Without it the likelihood has no highest point: the narrow side goes to 0 on one value. Chosen among 0, 5, 20 and 60
by leaving out days of the first week of the station of docs/real-station.md."""
MOST_ROUNDS = 40
NEAREST = 1e-4
"""Relative change of both widths at which the rounds end."""


def student_weight(distance: Floats) -> Floats:
    r"""Weight of a value at a distance in standard deviations, $(\nu + 1) / (\nu + z^2)$, at most 1.

    Examples
    --------
    >>> student_weight(np.array([0.0, 1.0, 6.0]))
    array([1.   , 1.   , 0.125])
    """
    return np.asarray(np.minimum((DEGREES + 1.0) / (DEGREES + distance**2), 1.0))


def split_sd(error: Floats, share: Floats, sd: float) -> tuple[float, float]:
    r"""Standard deviations of errors under and over 0, of Student's t in two halves; that over 0 is the wider one.

    $$\hat\sigma_\pm^2 = \frac{S_\pm^{2/3} \left(S_-^{1/3} + S_+^{1/3}\right)}{n}, \qquad
    S_\pm = \sum_{e \gtrless 0} w\, \frac{\nu + 1}{\nu + e^2 / \sigma_\pm^2}\, e^2$$

    is the most likely one where the mode is 0 [1]_. If the errors under 0 are the wider ones, nothing is lost in
    them and `sd` holds on both sides.

    Parameters
    ----------
    error : (n,) array
        Told over measured value less 1. [1]
    share : (n,) array
        What each value counts for, w.
    sd : float
        Where the rounds begin. [1]

    References
    ----------
    .. [1] K. F. Wallis (2014), The two-piece normal, binormal, or double Gaussian distribution, Statistical Science
       29(1), 106-112; the weights of Student's t are those of `DEGREES`.

    Examples
    --------
    >>> error = np.concatenate([np.linspace(-0.02, 0.0, 50), np.linspace(0.0, 0.08, 200)])
    >>> below, above = split_sd(error, np.ones(250), 0.03)
    >>> above > 3.0 * below
    True
    """
    is_above = error > 0.0
    below = above = sd
    for _ in range(MOST_ROUNDS):
        distance = error / np.where(is_above, above, below)
        squares = share * (DEGREES + 1.0) / (DEGREES + distance**2) * error**2
        sums = float(squares[~is_above].sum()), float(squares[is_above].sum())
        alike = ALIKE_VALUES * sum(sums) / (2.0 * float(share.sum()))
        roots = [np.cbrt(own + alike) for own in sums]
        values = float(share.sum()) + ALIKE_VALUES
        before = below, above
        below, above = (float(root * np.sqrt(sum(roots) / values)) for root in roots)
        if max(abs(below - before[0]), abs(above - before[1])) <= NEAREST * sd:
            break
    return (below, above) if above > below else (sd, sd)
