"""What no effect of the library does: discrepancies of any size, in any signal and regime."""

import numpy as np
from scipy.special import logsumexp

from wetwell.sim2real.likelihood.cells import TIMES
from wetwell.sim2real.likelihood.covariance import DIFFERING, POOR, Errors, Form
from wetwell.sim2real.likelihood.evidence import Evidence, Stirred, under
from wetwell.sim2real.likelihood.ways import RIGHT, Seen, Way, Ways

SCALES = TIMES[1:]
"""Times what is allowed that something unknown may be in a block, each as likely."""


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


def flexible_factor(found: Evidence, form: Form) -> float:
    r"""Logarithm of how much more probable the residuals are if something unknown may be in them.

    $$F = \prod_b \frac{\tfrac12\,p(r_b) + \tfrac12 \sum_k p_k\, p(r_b \mid \lambda_k, \mu_k)}{p(r_b)}$$

    over blocks b, with λ times what is allowed of offsets that all cycles share, and μ of what changes between them:
    one of them, or both alike.

    Parameters
    ----------
    found : Evidence
    form : Form
        Of the effects beside which it acts.
    """
    total = 0.0
    for one in found.stirred:
        left, its = found.residuals[one.block.rows], form.chosen(one.block.rows)
        wet = Seen(one.block, left, its, one.swing)
        dry = None if one.dry is None else Seen(one.dry, left, its, one.swing)
        known, *unknown = (_log(one, wet, dry, ways) for ways in (RIGHT, *UNKNOWN_WAYS))
        total += float(np.logaddexp(0.0, logsumexp(unknown) - np.log(len(unknown)) - known) - np.log(2.0))
    return total


def _log(one: Stirred, wet: Seen, dry: Seen | None, ways: Ways) -> float:
    """Logarithm of the probability of the residuals of a block, its surge and swing as they are, with rain or dry."""
    log = one.log_rain + _of_block(wet, ways)
    return log if dry is None else float(np.logaddexp(log, one.log_dry + _of_block(dry, ways)))


def _of_block(seen: Seen, ways: Ways) -> float:
    log, products = under(seen, seen.residuals[:, None], ways)
    return log - 0.5 * float(products[0, 0])
