"""When accepted effects leave too much of the gap."""

import numpy as np
import pytest

from wetwell.sim2real.attribution.attribution import Attribution
from wetwell.sim2real.attribution.fitting import Fit
from wetwell.sim2real.diagnosis.verdict import _is_wide
from wetwell.sim2real.residuals.bins import FLOW, LEVEL, SIGNALS, Bins

EACH = 40


def outcome(residuals, left):
    """Two signals of forty cycles each, ten times the noise before; accepted effects leave this in each."""
    whole, ones = np.arange(2 * EACH) % EACH, np.ones(2 * EACH)
    bins = Bins(
        signal=np.repeat([FLOW, LEVEL], EACH),
        regime=whole * 0,
        cycle=whole,
        pump=whole * 0,
        second=whole,
        deviation=ones,
        floor=ones,
        tolerance=0.0 * ones,
    )
    found = Attribution(
        plain=10.0 * ones,
        accepted=Fit(candidates=(), points=(), residuals=np.repeat(residuals, EACH)),
        left=np.repeat(left, EACH),
        equivalent=(),
        ends=np.zeros((0, 2)),
        singles=(),
        training=ones < 1.0,
        validation=ones > 0.0,
    )
    return bins, found


@pytest.mark.parametrize(
    ("residuals", "left", "told", "is_wide"),
    [
        ((3.0, 1.0), (3.0, 1.0), {FLOW, LEVEL}, True),
        ((3.0, 1.0), (1.0, 1.0), {FLOW, LEVEL}, False),  # a transient that is excused
        ((1.0, 3.0), (1.0, 3.0), {FLOW, LEVEL}, True),
        ((1.0, 3.0), (1.0, 3.0), {FLOW}, False),  # the level of an inflow that nobody measures
        ((1.0, 3.0), (1.0, 3.0), {len(SIGNALS) - 1}, False),  # nothing to go by
    ],
)
def test_what_is_excused_or_unknown_speaks_against_no_effect(residuals, left, told, is_wide):
    assert _is_wide(*outcome(residuals, left), told) == is_wide
