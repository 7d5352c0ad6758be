"""What no effect of the library does: discrepancies of any size, in any signal and regime."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import logsumexp

from wetwell.sim2real.likelihood.covariance import DIFFERING, POOR, Errors, Form, projected
from wetwell.sim2real.likelihood.evidence import Evidence
from wetwell.sim2real.likelihood.ways import OWN_WAYS, SPAN_WAYS, Way, Ways, likeliest

SCALES = (3.0, 10.0, 30.0)
"""Times what is allowed that something unknown may be in a block, each as likely."""


def _large(offset: float) -> tuple[Way]:
    return (Way(errors=Errors(offset=offset, form=POOR.form), is_poor=True),)


UNKNOWN_WAYS = tuple(
    ways
    for scale in SCALES
    for large, changing in [(_large(scale), _large(DIFFERING * scale))]
    for ways in (
        Ways(span=(*SPAN_WAYS, *large), is_known=False),
        Ways(own=(*OWN_WAYS, *large), is_known=False),
        Ways(changing=changing),
        Ways(span=large, changing=changing),
        Ways(own=large, changing=changing),
    )
)
"""What something unknown may be: in some spans, alike for all pumps or in each; in all of them, if it changes too."""


def flexible_factor(found: Evidence, form: Form) -> float:
    r"""Logarithm of how much more probable the residuals are if something unknown may be in them.

    $$F = \frac1B \sum_{m=1}^B \binom Bm^{-1} \sum_{|M| = m} \prod_{b \in M} o_b, \qquad
    o_b = \frac{\sum_k p_k\, p(r_b \mid \lambda_k)}{p(r_b)}$$

    over sets M of the B blocks that it acts in: nobody knows how many, and each number is as likely. In a block it
    has λ times what is allowed of offsets that all cycles share, and half of that of what changes between them, each
    in a share of its spans or groups.

    Parameters
    ----------
    found : Evidence
    form : Form
        Of the effects beside which it acts.
    """
    odds = []
    for one, known in zip(found.stirred, found.by_block, strict=True):
        rows = one.block.rows
        residuals, own = found.residuals[rows, None], form.chosen(rows)
        logs = []
        for ways in UNKNOWN_WAYS:
            log_prior, allowance = likeliest(one.block, residuals[:, 0], own, one.swing, ways)
            products, log_det = projected(one.block, residuals, own, allowance)
            logs.append(log_prior - 0.5 * (float(products[0, 0]) + log_det))
        odds.append(float(logsumexp(logs)) - np.log(len(logs)) - float(known))
    return _of_any_number(odds)


def _of_any_number(log_odds: Sequence[float]) -> float:
    """Logarithm of the mean over numbers of members of the mean over such sets of the product of the odds."""
    count = len(log_odds)
    sums = np.r_[0.0, np.full(count, -np.inf)]
    for odds in log_odds:
        sums[1:] = np.logaddexp(sums[1:], sums[:-1] + odds)
    sets = [math.log(math.comb(count, number)) for number in range(1, count + 1)]
    return float(logsumexp(sums[1:] - sets)) - math.log(count)
