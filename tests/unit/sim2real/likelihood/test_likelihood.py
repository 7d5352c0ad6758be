"""The likelihood against dense matrices, and what it must and must not gain from."""

from dataclasses import fields, replace
from itertools import product

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from wetwell.sim2real.likelihood.cells import POORLY, RAIN, cells_of
from wetwell.sim2real.likelihood.covariance import (
    GOOD,
    HARDLY_DIFFERENT,
    LATE,
    POOR,
    SWINGS,
    Allowance,
    Errors,
    Form,
    covariance_of,
    expected_squares,
    no_form,
)
from wetwell.sim2real.likelihood.evidence import TRUSTED, Member, cell_weights, evidence, evidence_of_none
from wetwell.sim2real.likelihood.flexible import flexible_factor
from wetwell.sim2real.likelihood.rain import rainy_cells
from wetwell.sim2real.likelihood.ways import CHANGING_WAYS, OWN_WAYS, SPAN_WAYS, Way
from wetwell.sim2real.recording.regimes import IDLE, MULTI_PUMP, STEADY
from wetwell.sim2real.residuals.bins import FLOW, HEAD, LEVEL, POWER, STOP_LEVEL, Bins

CYCLES = 12
MIDDLE = np.array([0.5, 0.5])
"""Of the ranges of two parameters."""


@pytest.fixture
def cells():
    """As `made`, with a meter of the inflow."""
    return made(has_inflow=True)


def made(*, has_inflow, is_each_second=True, seconds=(0, 70, 80), of_level=IDLE, longest=None):
    """A flow that runs and a level at rest, or in another regime: a span of one bin in a cycle, and one of two.

    The last one is in the cycles of `longest` alone, if these are given.
    """
    half = CYCLES * len(seconds)
    signal = np.repeat([FLOW, LEVEL], half)
    cycle = np.tile(np.repeat(np.arange(CYCLES), len(seconds)), 2)
    ones = np.ones(2 * half)
    bins = Bins(
        signal=signal,
        regime=np.where(signal == FLOW, STEADY, of_level),
        cycle=cycle,
        pump=np.where(signal == FLOW, 0, -1),
        second=1000 * cycle + np.tile(seconds, 2 * CYCLES),
        deviation=ones,
        floor=0.8 * ones,
        tolerance=0.1 * ones,
        material=np.where(signal == FLOW, 1.5, 0.7),
    )
    if longest is not None:
        kept = (bins.second % 1000 < seconds[-1]) | np.isin(cycle, longest)
        bins = Bins(**{field.name: getattr(bins, field.name)[kept] for field in fields(Bins)})
    return cells_of(bins, np.zeros(bins.size, dtype=int), has_inflow=has_inflow, is_each_second=is_each_second)


def never_poor(share, fixed):
    """Two parts that are independent: one of any form, and one of a form that is known, or nearly."""
    return np.hypot(np.sqrt(1.0 - fixed) * share, np.sqrt(fixed) * np.minimum(share, GOOD.form))


def dense(block, form, allowance):
    """The covariance, written down."""
    f, allowed, late = form.signature, block.allowed, form.late
    fixed = block.group_means(form.fixed)
    span, own, changing = allowance.span, allowance.own, allowance.changing
    changed = (changing.offset * allowed) ** 2 + block.surge * block.variance + (allowance.swing * form.swinging) ** 2
    in_cycle = np.sqrt(0.5 * changed)
    whole = np.diag(block.variance + 0.5 * changed + (never_poor(changing.form, form.fixed) * f) ** 2)
    same_cycle = block.cycle[:, None] == block.cycle[None, :]
    whole += same_cycle * np.outer(in_cycle, in_cycle)
    group, of_cell = block.group, block.span[block.group]
    same_group, same_span = group[:, None] == group[None, :], of_cell[:, None] == of_cell[None, :]
    for load, of_block, of_span, each in (
        (allowed, GOOD.offset, span.offset, own.offset),
        (block.group_means(f)[group], GOOD.form, never_poor(span.form, fixed), never_poor(own.form, fixed)),
    ):
        spans, groups = of_span[group], each[group]
        alike = of_block**2 + np.outer(spans, spans) * same_span + np.outer(groups, groups) * same_group
        whole += alike * np.outer(load, load)
    of_block, of_span, each = LATE
    return whole + (of_block**2 + of_span**2 * same_span + each**2 * same_group) * np.outer(late, late)


def some_form(cells, rng):
    return Form(
        signature=rng.normal(size=cells.group.size),
        fixed=rng.random(cells.group.size),
        swinging=rng.random(cells.group.size),
        late=rng.normal(size=cells.group.size),
    )


def test_cells_are_the_means_of_spans_in_cycles(cells):
    assert len(cells.blocks) == 2
    assert sorted(np.concatenate([block.rows for block in cells.blocks]).tolist()) == list(range(4 * CYCLES))
    np.testing.assert_allclose(np.sort(np.unique(cells.variance)), [0.4, 0.8])
    np.testing.assert_allclose(np.unique(cells.allowed.round(9)), np.hypot([0.7, 1.5], np.sqrt(0.2)).round(9))


def everywhere(block, span, own, changing, swing=0.5):
    """The same in all groups and cells."""
    groups, cells = np.ones(block.span.size), np.ones(block.rows.size)

    def filled(errors, ones):
        return Errors(offset=errors.offset * ones, form=errors.form * ones)

    return Allowance(
        span=filled(span, groups),
        own=filled(own, groups),
        changing=filled(changing, cells),
        swing=swing,
    )


@pytest.mark.parametrize(
    "errors",
    [
        (GOOD, HARDLY_DIFFERENT, HARDLY_DIFFERENT),
        (POOR, GOOD, POOR),
        (Errors(offset=3.0, form=0.3), HARDLY_DIFFERENT, GOOD),
    ],
    ids=str,
)
@pytest.mark.parametrize("has_form", [True, False])
@pytest.mark.parametrize("surge", [0.0, 3.0])
def test_products_are_those_of_the_dense_covariance(cells, errors, has_form, surge):
    rng = np.random.default_rng(5)
    columns, form = rng.normal(size=(cells.group.size, 3)), some_form(cells, rng) if has_form else no_form(cells)
    for without in cells.blocks:
        block = replace(without, surge=surge)
        own, allowance = form.chosen(block.rows), everywhere(block, *errors)
        products, log_det = covariance_of(block, own, allowance).projected(columns[block.rows])
        whole = dense(block, own, allowance)
        expected = columns[block.rows].T @ np.linalg.solve(whole, columns[block.rows])
        np.testing.assert_allclose(products, expected, rtol=1e-9)
        assert log_det == pytest.approx(np.linalg.slogdet(whole)[1], rel=1e-9)


def log_densities(cells, residuals, form=None):
    """Of all ways to be wrong together, block by block, but for the factors of 2π: (blocks, ...)."""
    found, form = [], form or no_form(cells)
    for block in cells.blocks:
        groups = block.span.size
        spans = block.span.max() + 1
        logs = []
        for span, own, changing in product(
            product(SPAN_WAYS, repeat=spans), product(OWN_WAYS, repeat=groups), product(CHANGING_WAYS, repeat=groups)
        ):
            allowance = Allowance(
                span=of_ways([span[k] for k in block.span]),
                own=of_ways(own),
                changing=of_ways([changing[k] for k in block.group]),
            )
            prior = sum(
                log_prior(ways, choices)
                for ways, choices in (
                    (span, SPAN_WAYS),
                    (own, OWN_WAYS),
                    (changing, CHANGING_WAYS),
                )
            )
            density = multivariate_normal(cov=dense(block, form.chosen(block.rows), allowance))
            log = density.logpdf(residuals[..., block.rows]) + 0.5 * block.rows.size * np.log(2.0 * np.pi)
            logs.append(log + prior)
        found.append(logsumexp(logs, axis=0))
    return np.array(found)


def of_ways(ways):
    return Errors(
        offset=np.array([way.errors.offset for way in ways]), form=np.array([way.errors.form for way in ways])
    )


def log_prior(ways, choices):
    """Of what was chosen, whether in a block that is prone to be poor or in one that is not."""
    poor = sum(way.is_poor for way in choices)
    return np.logaddexp.reduce(
        [
            np.log(of_block)
            + sum(np.log(share / poor if way.is_poor else (1.0 - share) / (len(choices) - poor)) for way in ways)
            for of_block, share in ((1.0 - POORLY, POORLY), (POORLY, 1.0 - POORLY))
        ]
    )


@pytest.mark.parametrize("poor", [0.0, 4.0], ids=["good", "one group poor"])
def test_the_evidence_of_none_is_nearly_that_of_all_ways_to_be_wrong(cells, poor):
    """They are weighed by the means of groups and their scatter, not by trying all of them together."""
    residuals = 0.5 * np.sqrt(cells.variance) * np.random.default_rng(6).normal(size=cells.group.size)
    residuals += poor * cells.allowed * (cells.group == 1)
    assert evidence_of_none(cells, residuals).log == pytest.approx(log_densities(cells, residuals).sum(), abs=2.0)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in (1, 2, 3))])
def test_cells_whose_form_may_be_off_by_much_say_little_of_what_all_have_alike(cells, seed):
    """Effects explain 30 times what is allowed in every second cycle; the others are off alike."""
    rng = np.random.default_rng(seed)
    cells = replace(cells, blocks=tuple(replace(block, variance=0.01 * block.allowed**2) for block in cells.blocks))
    is_explained = np.concatenate([block.cycle for block in cells.blocks]) % 2 == 0
    signature = np.where(is_explained, 30.0, 0.0) * cells.allowed
    residuals = (0.1 * rng.normal(size=signature.size) + np.where(is_explained, 0.0, 1.5)) * cells.allowed
    residuals += 0.175 * signature * rng.normal(size=signature.size)
    form = replace(no_form(cells), signature=signature)
    found = evidence(cells, residuals, np.zeros((signature.size, 0)), form, np.zeros(0))
    assert found.log == pytest.approx(log_densities(cells, residuals, form).sum(), abs=1.0)


@pytest.mark.parametrize("seed", range(4))
def test_what_all_groups_share_in_a_cycle_is_no_error_of_form(seed):
    """By itself each group seems to scatter by more than is allowed, for which a form that is off makes room."""
    rng = np.random.default_rng(seed)
    cells = made(has_inflow=True, seconds=(0, 1, 2, 5, 10, 20, 40, 80, 160, 320))
    cells = replace(cells, blocks=tuple(replace(block, variance=0.001 * block.allowed**2) for block in cells.blocks))
    of_cycle = 1.3 * rng.choice([-1.0, 1.0], CYCLES)
    of_cell = np.concatenate([of_cycle[block.cycle] for block in cells.blocks])
    residuals = (of_cell + 0.03 * rng.normal(size=of_cell.size)) * cells.allowed
    form = replace(no_form(cells), signature=16.0 * cells.allowed, fixed=np.full(of_cell.size, 0.97))
    shifted = Way(errors=Errors(offset=0.5, form=0.0), is_poor=True)
    log = 0.0
    for block in cells.blocks:
        groups, spans = block.span.size, int(block.span.max()) + 1
        assert groups >= 5
        its, allowance = form.chosen(block.rows), everywhere(block, GOOD, HARDLY_DIFFERENT, shifted.errors)
        whole = dense(block, its, replace(allowance, swing=SWINGS[0]))
        log -= 0.5 * float(residuals[block.rows] @ np.linalg.solve(whole, residuals[block.rows]))
        log -= 0.5 * np.linalg.slogdet(whole)[1]
        log += log_prior(SPAN_WAYS[:1] * spans, SPAN_WAYS) + log_prior(OWN_WAYS[:1] * groups, OWN_WAYS)
        log += log_prior((shifted,) * groups, CHANGING_WAYS)
    assert evidence(cells, residuals, np.zeros((of_cell.size, 0)), form, np.zeros(0)).log > log


def test_further_effects_are_weighed_as_the_evidence_weighs_its_own(cells):
    rng = np.random.default_rng(4)
    residuals, slopes = rng.normal(size=cells.group.size), rng.normal(size=(cells.group.size, 2))
    form = some_form(cells, rng)
    found = evidence(cells, residuals, 1e-3 * slopes, form, MIDDLE)
    np.testing.assert_allclose(cell_weights(found, form).products(1e-3 * slopes), found.precision)


def test_a_parameter_is_integrated_over_its_range(cells):
    """Against a sum over a fine grid of the parameter, whose prior is even over its range."""
    rng = np.random.default_rng(7)
    slope = 40.0 * rng.normal(size=cells.group.size)
    residuals = 0.5 * rng.normal(size=cells.group.size)
    grid = np.linspace(-0.05, 0.05, 201)  # a tenth of the range: a hundred more off in the logarithm beyond it
    logs = log_densities(cells, residuals + grid[:, None] * slope).sum(axis=0)
    best = int(np.argmax(logs))
    expected = float(np.log(np.sum(np.exp(logs - logs[best])) * (grid[1] - grid[0])) + logs[best])
    found = evidence(cells, residuals + grid[best] * slope, slope[:, None], no_form(cells), MIDDLE[:1])
    assert found.log == pytest.approx(expected, abs=0.25)
    inner = np.exp(logs - logs[best])
    variance = float(np.sum(inner * (grid - grid[best]) ** 2) / inner.sum())
    assert 1.0 / found.precision[0, 0] == pytest.approx(variance, rel=0.2)


@pytest.mark.parametrize("away", [0.3, 0.02, 0.004])
def test_no_fit_is_weighed_further_away_than_its_slopes_hold(cells, away):
    """However steep they are: a lag of .3 s was once weighed where slopes put it at 5 s."""
    rng = np.random.default_rng(21)
    slopes = 1e4 * rng.normal(size=(cells.group.size, 2)) * cells.allowed[:, None]
    residuals = np.sqrt(cells.variance) * rng.normal(size=cells.group.size) - slopes @ (away, 0.1 * away)
    found = evidence(cells, residuals, slopes, no_form(cells), MIDDLE)
    assert np.abs(found.step).max() == pytest.approx(min(away, TRUSTED), rel=0.05)
    np.testing.assert_allclose(found.residuals, residuals + slopes @ found.step)


def test_no_fit_is_weighed_beyond_its_ranges_and_the_others_make_up_for_it(cells):
    """An exponent at the end of its range held all others where the fit had left them."""
    rng = np.random.default_rng(22)
    slopes = 400.0 * rng.normal(size=(cells.group.size, 2)) * cells.allowed[:, None]
    slopes[:, 1] += 0.5 * slopes[:, 0]
    residuals = np.sqrt(cells.variance) * rng.normal(size=cells.group.size) - slopes @ (0.008, 0.004)
    found = evidence(cells, residuals, slopes, no_form(cells), np.array([1.0, 0.3]))
    least = np.linalg.lstsq(slopes[:, 1:] / cells.allowed[:, None], -residuals / cells.allowed, rcond=None)[0]
    assert found.step == pytest.approx([0.0, float(least[0])], rel=0.1, abs=1e-9)
    assert 0.004 < found.step[1] < TRUSTED


def test_what_needs_an_effect_that_goes_straight_is_its_distance_from_neutral(cells):
    """Wald's square, the parameter of the other effect free; a limit has no slope, and is needed all the same."""
    rng = np.random.default_rng(13)
    slopes = 400.0 * rng.normal(size=(cells.group.size, 2)) * cells.allowed[:, None]
    residuals = np.sqrt(cells.variance) * rng.normal(size=cells.group.size)
    way = 0.004
    members = [
        Member(parameters=np.array([k]), neutral={k: way}, absent=way * slopes[:, k] * (1 + k)) for k in range(2)
    ]
    found = evidence(cells, residuals, slopes, no_form(cells), MIDDLE, members)
    for k in range(2):
        away = way * (1 + k) - found.step[k]
        assert found.needed[k] == pytest.approx(away**2 / np.linalg.inv(found.precision)[k, k], rel=0.05)
    limit = Member(parameters=np.array([0]), neutral={0: way}, absent=members[0].absent)
    blunt = evidence(cells, residuals, np.zeros((cells.group.size, 1)), no_form(cells), MIDDLE[:1], [limit])
    assert blunt.needed[0] > 10.0


def test_an_offset_under_the_allowed_size_gains_little_and_one_over_it_does(cells):
    """However many cycles agree on it."""
    noise = np.sqrt(cells.variance) * np.random.default_rng(8).normal(size=cells.group.size)
    for size, least, most in ((0.3, -np.inf, 1.0), (8.0, 10.0, np.inf)):
        offset = size * cells.allowed
        with_effect = evidence(
            cells, noise, offset[:, None], replace(no_form(cells), signature=offset), MIDDLE[:1]
        ).log
        assert least < with_effect - evidence_of_none(cells, noise + offset).log < most, size


@pytest.mark.parametrize(("regime", "is_unknown"), [(IDLE, True), (MULTI_PUMP, False)])
def test_storms_may_all_do_alike_to_a_level_whose_inflow_nobody_measures(regime, is_unknown):
    cells = made(has_inflow=False, of_level=regime)
    (level,) = (block for block in cells.blocks if block.signal == LEVEL)
    residuals = np.sqrt(cells.variance) * np.random.default_rng(31).normal(size=cells.group.size)
    residuals[level.rows] += 6.0 * np.sqrt(level.variance)
    assert (unknown_in(cells, residuals) > 3.0) == is_unknown


@pytest.mark.parametrize(
    ("longest", "has_inflow", "is_of_storms"), [((3, 7), False, False), ((3,), False, True), ((3,), True, False)]
)
def test_a_run_that_lasts_longer_than_nine_of_ten_is_that_of_a_storm(longest, has_inflow, is_of_storms):
    """An inflow that falls for an hour leaves the observer behind it, alike in each storm."""
    cells = made(has_inflow=has_inflow, of_level=STEADY, seconds=(0, 70, 900), longest=longest)
    (level,) = (block for block in cells.blocks if block.signal == LEVEL)
    may_be = level.allowed >= np.sqrt(RAIN * level.variance)
    is_late = level.group == level.group.max()
    assert is_late.sum() == len(longest)
    assert not may_be[~is_late].any()
    assert may_be[is_late].all() == is_of_storms


def unknown_in(cells, residuals):
    return flexible_factor(evidence_of_none(cells, residuals), no_form(cells))


def test_only_what_is_far_over_the_allowed_size_asks_for_something_unknown(cells):
    rng = np.random.default_rng(9)
    noise = np.sqrt(cells.variance) * rng.normal(size=cells.group.size)
    assert unknown_in(cells, noise) < 0.0
    assert unknown_in(cells, noise + 0.7 * cells.allowed) < 0.0
    assert unknown_in(cells, noise + 12.0 * cells.allowed) > 0.0
    assert unknown_in(cells, noise + 12.0 * rng.normal(size=cells.group.size) * cells.allowed) > 0.0


def of_many_blocks(signals=(FLOW, HEAD, POWER)):
    """Flow, head and power in five regimes: a bin in each of twelve cycles."""
    signal, regime, cycle = (one.ravel() for one in np.meshgrid(signals, range(5), range(CYCLES)))
    ones = np.ones(signal.size)
    bins = Bins(
        signal=signal,
        regime=regime,
        cycle=cycle,
        pump=np.zeros(signal.size, dtype=int),
        second=1000 * cycle,
        deviation=ones,
        floor=0.8 * ones,
        tolerance=0.1 * ones,
        material=ones,
    )
    return cells_of(bins, np.zeros(bins.size, dtype=int), has_inflow=True, is_each_second=True)


def test_something_unknown_may_act_in_one_block_of_many():
    """A head that comes late shows in starts and stops alone; in what share of all it would show nobody knows."""
    cells = of_many_blocks()
    residuals = 0.5 * np.sqrt(cells.variance) * np.random.default_rng(22).normal(size=cells.group.size)
    blocks = len(cells.blocks)
    assert blocks == 15
    assert -np.log(blocks + 1.0) < unknown_in(cells, residuals) < -1.5
    residuals[cells.blocks[4].rows] += 10.0 * cells.allowed[cells.blocks[4].rows]
    assert unknown_in(cells, residuals) > 0.0


@pytest.mark.parametrize(("signal", "least", "most"), [(FLOW, -10.0, 0.0), (STOP_LEVEL, 2.0, 40.0)])
def test_a_threshold_that_is_off_by_three_times_what_matters_is_no_error_of_a_right_model(signal, least, most):
    """A flow of a start may be poor; a level at which a pump is stopped is compared with a number."""
    cells = of_many_blocks((FLOW, HEAD, STOP_LEVEL))
    residuals = 0.5 * np.sqrt(cells.variance) * np.random.default_rng(24).normal(size=cells.group.size)
    (off,) = (block for block in cells.blocks if (block.signal, block.regime) == (signal, 3))
    residuals[off.rows] += 3.0 * off.allowed
    assert least < unknown_in(cells, residuals) < most


def test_readings_of_nothing_say_nothing_of_what_else_there_is():
    """A pump that stands has no flow, whatever is the matter elsewhere."""
    cells = of_many_blocks()
    silent = np.isin(np.arange(cells.group.size), np.concatenate([block.rows for block in cells.blocks[5:]]))
    variance = np.where(silent, 0.0, cells.variance)
    blocks = tuple(replace(block, variance=variance[block.rows]) for block in cells.blocks)
    residuals = 0.5 * np.sqrt(variance) * np.random.default_rng(23).normal(size=cells.group.size)
    alone = replace(cells, blocks=cells.blocks[:5])
    assert unknown_in(replace(cells, variance=variance, blocks=blocks), residuals) == pytest.approx(
        unknown_in(alone, residuals)
    )


def test_an_error_of_a_whole_cycle_is_less_of_a_surprise_than_as_many_of_single_cells(cells):
    rng = np.random.default_rng(11)
    level = next(block for block in cells.blocks if block.signal == LEVEL)
    shared, single = np.zeros(cells.group.size), np.zeros(cells.group.size)
    shared[level.rows] = np.repeat(2.0, level.rows.size) * rng.choice([-1.0, 1.0], CYCLES)[level.cycle]
    single[level.rows] = 2.0 * rng.choice([-1.0, 1.0], level.rows.size)
    assert evidence_of_none(cells, shared).log > evidence_of_none(cells, single).log


def test_surges_of_an_inflow_without_a_meter_are_no_surprise_in_the_level_and_one_in_the_flow():
    with_meter, without = made(has_inflow=True), made(has_inflow=False)
    noise = np.random.default_rng(12).normal(size=with_meter.group.size) * np.sqrt(with_meter.variance)
    for signal, gains in ((LEVEL, True), (FLOW, False)):
        (rows,) = [block.rows for block in with_meter.blocks if block.signal == signal]
        residuals = noise.copy()
        residuals[rows] *= 2.5
        gain = evidence_of_none(without, residuals).log - evidence_of_none(with_meter, residuals).log
        assert (gain > 1.0) == gains
        factors = [unknown_in(each, residuals) for each in (with_meter, without)]
        assert (factors[1] < factors[0] - 0.1) == gains


def test_slow_rows_with_a_meter_may_hide_more_than_the_station_file_says_but_no_rain():
    slow = made(has_inflow=True, is_each_second=False)
    noise = 2.0 * np.random.default_rng(13).normal(size=slow.group.size) * np.sqrt(slow.variance)
    each_second, unmetered = made(has_inflow=True), made(has_inflow=False, is_each_second=False)
    logs = [evidence_of_none(cells, noise).log for cells in (slow, unmetered, each_second)]
    assert logs[0] > logs[2] + 1.0
    assert [[block.may_rain for block in cells.blocks] for cells in (slow, unmetered)] == [[False] * 2, [False, True]]


def test_what_no_surge_makes_is_no_likelier_unknown_where_there_may_be_one():
    """What is known and what is not are weighed with the same surge; rain in all cycles is unlikely only."""
    noise = np.random.default_rng(14).normal(size=made(has_inflow=True).group.size)
    factors = []
    for has_inflow in (True, False):
        cells = made(has_inflow=has_inflow)
        residuals = 0.3 * noise * np.sqrt(cells.variance)
        for block in cells.blocks:
            residuals[block.rows] += (block.signal == LEVEL) * 3.0 * cells.allowed[block.rows]
        factors.append(unknown_in(cells, residuals))
    assert 0.0 < factors[0] - 1.0 < factors[1] < factors[0] + 0.05


def test_rain_in_some_cycles_is_nothing_unknown_and_the_same_in_all_is():
    cells = made(has_inflow=False)
    noise = np.random.default_rng(15).normal(size=cells.group.size) * np.sqrt(cells.variance)
    (level,) = [block for block in cells.blocks if block.signal == LEVEL]
    for cycles, size, is_unknown in (([3, 7], 6.0, False), (range(CYCLES), 12.0, True)):
        residuals = noise.copy()
        residuals[level.rows] += size * np.isin(level.cycle, cycles) * cells.allowed[level.rows]
        assert (unknown_in(cells, residuals) > 0.0) == is_unknown


def test_rain_is_summed_over_as_it_would_be_cycle_by_cycle():
    (block,) = [block for block in made(has_inflow=False).blocks if block.signal == LEVEL]
    block = replace(block, surge=1.0, in_storm=np.arange(CYCLES) == 1)
    residuals = np.random.default_rng(16).normal(size=block.rows.size) * np.where(block.cycle < 3, 6.0, 1.0)
    is_rainy, log = rainy_cells(block, residuals)
    assert set(block.cycle[is_rainy]) <= {0, 1, 2}
    assert is_rainy.any()
    expected = 0.0
    for cycle in range(CYCLES):
        at = np.flatnonzero(block.cycle == cycle)
        logs = []
        for rain in (0.0, RAIN):
            surging = 0.5 * (1.0 + rain) * block.variance[at]
            whole = np.diag(expected_squares(block)[at] + surging) + np.outer(np.sqrt(surging), np.sqrt(surging))
            logs.append(multivariate_normal(cov=whole).logpdf(residuals[at]))
        rain = 1.0 - POORLY if cycle == 1 else POORLY
        expected += logsumexp(logs, b=[1.0 - rain, rain]) - logs[int(is_rainy[at[0]])]
    assert log == pytest.approx(expected)


def test_several_pumps_tell_of_rain():
    """However many cycles it is: the level of those is no sign of something unknown."""
    cells = made(has_inflow=False)
    noise = np.random.default_rng(17).normal(size=cells.group.size) * np.sqrt(cells.variance)
    factors = []
    for in_storm in (False, True):
        blocks = tuple(replace(block, in_storm=np.full(CYCLES, in_storm)) for block in cells.blocks)
        each = replace(cells, blocks=blocks)
        (level,) = [block for block in blocks if block.signal == LEVEL]
        residuals = noise.copy()
        residuals[level.rows] += 5.0 * cells.allowed[level.rows]
        factors.append(unknown_in(each, residuals))
    assert factors[0] > 5.0 - np.log(1.5)  # of two blocks one alone has a sixth, as any share is as likely
    assert factors[1] < 0.0
