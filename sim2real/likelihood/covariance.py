"""Covariance of the cells of a block: noise, what a right model may be off, and errors of form of the effects."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.sim2real.likelihood.cells import Block, Cells
from wetwell.sim2real.likelihood.marginal import alike, eliminated

OFFSET = 0.3
"""Standard deviation of the error of a good model, over what is allowed: in a block, and in a span of time. [1]"""
GOOD_FORM = 0.04
"""The same of the error of form of a good effect, as a share of what it explains. [1]"""
POOR_FORM = 0.35
"""The same of a poor one, as in seconds of starts; an error of the model is then as large as is allowed. [1]"""
DIFFERING = 0.5
"""Ratio of errors that differ between pumps, or from cycle to cycle, to those that are alike. [1]"""
SWINGS = (0.1, 0.5, 1.5)
"""Error of form of effects that are known by how much they swing in time, not by their course; each as likely. [1]"""
LATE = (1.0, 0.0, 0.1)
"""How alike pumps and spans of time are early or late: in a block, in a span, each by itself. [1]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Standard deviations: in units of what is allowed, and as a share of what the effects explain; also arrays."""

    offset: float | Floats
    form: float | Floats

    def times(self, share: float) -> "Errors":
        """A share of them."""
        return Errors(offset=share * self.offset, form=share * self.form)


GOOD = Errors(offset=OFFSET, form=GOOD_FORM)
POOR = Errors(offset=1.0, form=POOR_FORM)
HARDLY_DIFFERENT = Errors(offset=DIFFERING * OFFSET, form=GOOD_FORM / POOR_FORM * GOOD_FORM)
"""Where a form repeats, what differs is as small beside a good form as that is beside a poor one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Allowance:
    """What may be wrong in a block.

    Attributes
    ----------
    span : Errors
        (groups,) of what pumps and cycles share in a span of time.
    own : Errors
        (groups,) of what cycles share in a group.
    changing : Errors
        (k,) of what changes from cycle to cycle.
    swing : float
        Of `SWINGS`.
    """

    span: Errors
    own: Errors
    changing: Errors
    swing: float = SWINGS[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """What the form of the effects may have wrong.

    Attributes
    ----------
    signature : (cells,) array
        What the effects explain, in one number: the root of the sum of squares of what each does, or what they do
        together where that is more: one effect that is split into two has no better form.
    fixed : (cells,) array
        Share of its square that is of effects whose name fixes their equation: these are never poor in form. [1]
    swinging : (cells,) array
        Root mean square, within its block, of what those do that swing in time.
    late : (cells,) array
        Change of what they explain within the time by which each may be early or late.
    """

    signature: Floats
    fixed: Floats
    swinging: Floats
    late: Floats

    def chosen(self, rows: Integers) -> "Form":
        """Of some of the cells."""
        return Form(
            signature=self.signature[rows],
            fixed=self.fixed[rows],
            swinging=self.swinging[rows],
            late=self.late[rows],
        )


def no_form(cells: Cells) -> Form:
    """Where there are no effects."""
    return form_of_nothing(cells.group.size)


def form_of_nothing(cells: int) -> Form:
    """Of as many cells in which no effect does anything."""
    nothing = np.zeros(cells)
    return Form(signature=nothing, fixed=nothing, swinging=nothing, late=nothing)


def of_form(share: float | Floats, fixed: Floats) -> Floats:
    """Error of form where some of what the effects explain has but one: of that it is no larger than a good one's."""
    return np.sqrt((1.0 - fixed) * np.square(share) + fixed * np.square(np.minimum(share, GOOD_FORM)))


def expected_squares(block: Block) -> Floats:
    """(k,) mean squares of the residuals of a good model: noise, and what it may be off."""
    return np.asarray(block.variance + expected_offset(block.allowed), dtype=np.float64)


def expected_offset(allowed: Floats) -> Floats:
    """Mean squares of what a good model may be off where so much is allowed."""
    return np.asarray((2.0 + 2.0 * DIFFERING**2) * OFFSET**2 * allowed**2, dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class Covariance:
    """Covariance of the k cells of a block, as far as it goes by no columns.

    Attributes
    ----------
    weight : (k,) array
        Inverse of the variance of each cell by itself.
    in_cycle : (k,) array
        Standard deviation of what the cells of a cycle share.
    loads : (parts, k) array
        What is allowed, the form, and what is late, on each cell.
    group, cycle : (k,) arrays
        Numbers from 0.
    prior : (parts · groups, parts · groups) array
        Precision of what is wrong in each part and group.
    log_det : float
        Logarithm of the determinants of the variances and of what is wrong.
    """

    weight: Floats
    in_cycle: Floats
    loads: Floats
    group: Integers
    cycle: Integers
    prior: Floats
    log_det: float

    def projected(self, columns: Floats) -> tuple[Floats, float]:
        """Products of (k, n) columns under the inverse, and the logarithm of the determinant.

        Returns
        -------
        products, log_determinant : (n, n) array, float

        References
        ----------
        .. [1] W. W. Hager, Updating the inverse of a matrix, SIAM Review 31, 1989 (Woodbury's identity).
        """
        unknown, count = self.prior.shape[0], columns.shape[1]
        joint = np.zeros((unknown + count, unknown + count))
        joint[:unknown, :unknown] = self.prior
        by_cycle = np.zeros((int(self.cycle.max()) + 1, unknown + count + 1))
        log_det = self.log_det + eliminated(
            np.ascontiguousarray(columns),
            self.weight,
            self.in_cycle,
            self.loads,
            self.group,
            self.cycle,
            joint,
            by_cycle,
        )
        return joint[unknown:, unknown:], log_det


def covariance_of(block: Block, form: Form, allowance: Allowance) -> Covariance:
    r"""Of a block, the form of effects on its cells, and what may be wrong.

    $$C = \operatorname{diag}\left(\sigma^2 + d^2 + (s_c f)^2\right) + \sum_c d_c d_c^T
    + A\left(a; o_b, o_s, o_g\right) + A\left(\bar f; s_b, s_s, s_g\right) + A\left(t; \lambda\right), \quad
    d^2 = \tfrac12 \left((c a)^2 + u \bar\sigma^2 + (w f_w)^2\right)$$

    $$A(x; b, s, g) = b^2 x x^T + \sum_{\text{spans}} s^2 x_s x_s^T + \sum_{\text{groups}} g^2 x_g x_g^T$$

    with what is allowed a, the signature f and its mean in a group, what is late t with `LATE` λ, what swings $f_w$,
    the surge u of the average variance $\bar\sigma^2$, and the `Allowance` of changes c and $s_c$, spans s, groups g
    and swing w; the sum is over cycles.
    """
    own = allowance.changing
    changing = 0.5 * (
        (own.offset * block.allowed) ** 2 + block.surge * block.of_inflow + (allowance.swing * form.swinging) ** 2
    )
    variance = block.variance + changing + (of_form(own.form, form.fixed) * form.signature) ** 2
    span, each = allowance.span, allowance.own
    parts: list[tuple[Floats, float, float | Floats, float | Floats]] = [
        (block.allowed, OFFSET, span.offset, each.offset)
    ]
    if np.any(form.signature):
        fixed = block.group_means(form.fixed)
        load = block.group_means(form.signature)[block.group]
        parts.append((load, GOOD_FORM, of_form(span.form, fixed), of_form(each.form, fixed)))
    if np.any(form.late):
        parts.append((form.late, *LATE))
    groups = block.span.size
    prior = np.zeros((groups * len(parts), groups * len(parts)))
    log_det = float(np.sum(np.log(variance)))
    for i, (_, of_block, of_span, of_group) in enumerate(parts):
        place = slice(i * groups, (i + 1) * groups)
        own_of_span, own_of_group = (np.broadcast_to(one, block.span.shape) for one in (of_span, of_group))
        log_det += alike(block.span, of_block, own_of_span, own_of_group, np.zeros((3, groups)), prior[place, place])
    return Covariance(
        weight=1.0 / variance,
        in_cycle=np.sqrt(changing),
        loads=np.array([load for load, *_ in parts]),
        group=block.group,
        cycle=block.cycle,
        prior=prior,
        log_det=log_det,
    )
