"""What no effect of the library does: discrepancies of any size, in any signal and regime."""

from collections.abc import Collection

import numpy as np
from scipy.special import logsumexp

from wetwell.sim2real.likelihood.cells import TIMES
from wetwell.sim2real.likelihood.covariance import DIFFERING, POOR, Errors, Form, form_of_nothing
from wetwell.sim2real.likelihood.evidence import Evidence, Stirred, under
from wetwell.sim2real.likelihood.falls import Falls
from wetwell.sim2real.likelihood.ways import Seen, Way, Ways, right_ways

SCALES = TIMES[1:]
"""Times what is allowed that something unknown may be in a block, each as likely."""
SILENT = 1e-3
"""Share of what is allowed under which noise and error of a reading are nothing: a pump stands. [1]"""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)
ACTING, LOG_WEIGHTS = 0.5 * (1.0 + _NODES), np.log(0.5 * _WEIGHTS)
"""Shares of the blocks in which something unknown acts, and how they sum up to an integral over all. [1]"""

_LARGE = [(Way(errors=Errors(offset=scale, form=POOR.form), is_poor=True),) for scale in SCALES]
_SMALLER = [(Way(errors=one.errors.times(DIFFERING), is_poor=True),) for (one,) in _LARGE]
UNKNOWN_WAYS = (
    *(Ways(span=large) for large in _LARGE),
    *(Ways(own=large) for large in _LARGE),
    *(Ways(changing=smaller) for smaller in _SMALLER),
    *(Ways(span=large, changing=smaller) for large, smaller in zip(_LARGE, _SMALLER, strict=True)),
    *(Ways(own=large, changing=smaller) for large, smaller in zip(_LARGE, _SMALLER, strict=True)),
)
"""What something unknown may be: alike for all pumps or in each, changing, or both; each as likely."""


def flexible_factor(found: Evidence, form: Form, named: Collection[int] = (), falls: Falls | None = None) -> float:
    r"""Logarithm of how much more probable the residuals are if something unknown may be in them.

    $$F = \int_0^1 \prod_b \frac{(1 - s)\,p(r_b) + s \sum_k p_k\, p(r_b \mid \lambda_k, \mu_k)}{p(r_b)}\,
    \mathrm{d}s$$

    over blocks b and the share s of them in which it acts, of which nobody knows anything, with λ times what is
    allowed of offsets that all cycles share, and μ of what changes between them: one of them, or both alike. Readings
    without noise that are what was expected, as those of a pump that stands, say nothing of what else there is. Falls
    of the level at rest are a block of their own: nothing of the library makes any.

    Parameters
    ----------
    found : Evidence
    form : Form
        Of the effects beside which it acts.
    named : collection of int
        Signals in which nothing unknown can be: only effects that are known make values lie on a lattice.
    falls : Falls, optional
    """
    total = np.zeros(ACTING.size)
    parts = [(one, found.residuals, form) for one in found.stirred if one.block.signal not in named]
    if falls is not None:
        parts.append((Stirred(block=falls.block), falls.left_m, form_of_nothing(falls.left_m.size)))
    for one, residuals, forms in parts:
        nothing = (SILENT * one.block.allowed) ** 2
        says = np.maximum(residuals[one.block.rows] ** 2, one.block.variance) > nothing
        if not says.any():
            continue
        block = one.block.only(says)
        left, its = residuals[block.rows], forms.chosen(block.rows)
        wet = Seen(block, left, its, one.swing)
        dry = None if one.dry is None else Seen(one.dry.only(says), left, its, one.swing)
        known, *unknown = (_log(one, wet, dry, ways) for ways in (right_ways(block), *UNKNOWN_WAYS))
        total += np.logaddexp(np.log1p(-ACTING), np.log(ACTING) + logsumexp(unknown) - np.log(len(unknown)) - known)
    return float(logsumexp(LOG_WEIGHTS + total))


def _log(one: Stirred, wet: Seen, dry: Seen | None, ways: Ways) -> float:
    """Logarithm of the probability of the residuals of a block, its surge and swing as they are, with rain or dry."""
    log = one.log_rain + _of_block(wet, ways)
    return log if dry is None else float(np.logaddexp(log, one.log_dry + _of_block(dry, ways)))


def _of_block(seen: Seen, ways: Ways) -> float:
    log, products = under(seen, seen.residuals[:, None], ways)
    return log - 0.5 * float(products[0, 0])
