"""The acts beneath "what to do": what each brings and costs, its limits, and what may not be done."""

import re
from html import unescape

import pytest

from wetwell.services.reports.gap.experiments import experiments_table
from wetwell.sim2real.attribution.possible import PossibleSet
from wetwell.sim2real.diagnosis.report import Gap, GapReport
from wetwell.sim2real.experiments.conditions import Conditions
from wetwell.sim2real.experiments.proposals import proposals_of
from wetwell.sim2real.experiments.reported import proposed_acts, refused_acts
from wetwell.simulator.effects import EFFECTS

CONDITIONS = Conditions(
    inflow_m3h=60.0, signals=("level_m", "flow_m3h", "head_m", "power_kw"), rate_s=1.0, value="instant"
)
ALIKE = (
    PossibleSet(effects=(EFFECTS["pump_wear"](head_loss=0.05),), probability=0.55, spread=()),
    PossibleSet(effects=(EFFECTS["motor_slip"](slip=0.025),), probability=0.45, spread=()),
)


def report_of(station):
    found = proposals_of(station, ALIKE, CONDITIONS)
    gap = Gap(before=2.0, after=1.0, floor=1.0, shrinkage=0.9, shrinkage_ci=(0.8, 1.0), by_signal={})
    return GapReport(
        station="alpha", verdict="effect", where=(), effects=(), candidates=(), gap=gap, closed_loop=None, signals=(),
        cycles=9, next_experiment="x", experiments=proposed_acts(found), refused=refused_acts(found),
    )  # fmt: skip


def rows_of(html):
    cells = [re.findall(r"<td>(.*?)</td>", row) for row in re.findall(r"<tr>(.*?)</tr>", html)]
    return [row for row in cells if row]


@pytest.fixture(scope="module")
def report(alpha):
    """At most one start an hour: some acts may not be done."""
    return report_of(
        alpha.model_copy(update={"control": alpha.control.model_copy(update={"max_starts_per_hour": 1})})
    )


def test_each_act_has_a_row_with_what_it_brings_costs_and_tells_apart(report):
    html = experiments_table(report, are_prices_default=True)
    assert html.startswith("<details><summary>Which acts would tell more, and what they cost")
    assert "at default prices" in html
    rows = rows_of(html)
    assert report.experiments
    assert [row[0] for row in rows[: len(report.experiments)]] == [act.sentence for act in report.experiments]
    for row, act in zip(rows, report.experiments, strict=False):
        _, bits, truth, price, work, length, water, energy, limits, apart = row
        assert float(bits) == pytest.approx(act.information_bits, abs=0.005)
        beyond, _, percent = unescape(truth).removesuffix("%").rpartition(">")
        assert beyond == ""
        assert float(percent) == pytest.approx(100.0 * act.truth_probability, rel=0.01, abs=0.1)
        assert [float(price), float(water)] == pytest.approx([act.price, act.costs_m3], abs=0.5)
        tenths = [act.crew_h, act.length_h, act.extra_kwh]
        assert [float(work), float(length), float(energy)] == pytest.approx(tenths, abs=0.051)
        assert re.search(r"level|pump \d at \d+ %|shut|none", limits)
        assert all(name.replace("_", " ") in apart for names in act.separates for name in names)


def test_acts_that_break_a_rule_stand_beneath_with_the_rule(report):
    rows = rows_of(experiments_table(report, are_prices_default=False))
    assert report.refused
    assert rows[len(report.experiments) :] == [[act.act.replace("_", " "), act.reason] for act in report.refused]
    assert "default prices" not in experiments_table(report, are_prices_default=False)


def test_without_any_act_there_is_nothing_to_open(report):
    bare = report.model_copy(update={"experiments": (), "refused": ()})
    assert experiments_table(bare, are_prices_default=True) == ""
