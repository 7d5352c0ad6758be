"""Duty points against closed forms and against scipy.optimize.brentq on the plain equations.

Flows agree to 1e-8 m³/h: the header is solved to 1e-10 m³/h, brentq to 1e-12 times the flow.
"""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from wetwell.protocols.station.rising_main import RisingMain
from wetwell.protocols.station.station_file import EffectTable
from wetwell.simulator.duty import duty_flows_m3h, duty_table
from wetwell.simulator.effects import effective_parameters
from wetwell.simulator.hydraulics import (
    common_flows,
    flow_at_head_m3h,
    header_back_flow_m3h,
    individual_flow_m3h,
    pump_head_m,
)
from wetwell.simulator.power import electrical_power_kw, hydraulic_power_kw

PAPER_CURVE = (36.0, -0.02333, -1.3333e-4)
SMALL_CURVE = (28.0, -0.05, -2.0e-4)
FLAT_CURVE = (30.0, 0.0, -4.0e-4)
TOLERANCE_M3H = 1e-8


def individual_flows(curves, speed_ratio, static_head_m, friction_h2_m5):
    pumps = zip(np.array(curves), speed_ratio, strict=True)
    flows = [
        individual_flow_m3h(curve, ratio, static_head_m, friction_h2_m5, 0.0, 0.0, 0.0) for curve, ratio in pumps
    ]
    return np.array(flows)


def header_flows(
    curves, speed_ratio, static_head_m, friction_h2_m5, *, own_h2_m5=0.0, linear_flow_m3h=0.0, leak_m3h=0.0
):
    """At rest: without inertia what ran back before does not count."""
    flow_m3h = np.zeros(len(curves))
    common_flows(
        *(np.arange(len(curves)), np.array(curves), np.array(speed_ratio), static_head_m),
        *(own_h2_m5, friction_h2_m5, linear_flow_m3h, 0.0, leak_m3h, 0.0, flow_m3h),
    )
    return flow_m3h


def plain_head_m(curve, speed_ratio, flow_m3h):
    c0, c1, c2 = curve
    return c0 * speed_ratio * speed_ratio + c1 * speed_ratio * flow_m3h + c2 * flow_m3h * flow_m3h


def brentq_flow_m3h(curve, speed_ratio, system_head_m):
    """Flow where the pump's head meets a head that is a function of its flow; zero if it cannot open its valve."""

    def excess(flow_m3h):
        return plain_head_m(curve, speed_ratio, flow_m3h) - system_head_m(flow_m3h)

    return brentq(excess, 0.0, 1e4, xtol=1e-12, rtol=1e-14) if excess(0.0) > 0 else 0.0


def brentq_header(curves, speed_ratio, static_head_m, friction_h2_m5):
    """Flows on a header, with the header's head (not the total flow) as the unknown."""

    def flows(head_m):
        pairs = zip(curves, speed_ratio, strict=True)
        return [brentq_flow_m3h(curve, ratio, lambda _: head_m) for curve, ratio in pairs]

    highest_m = max(curve[0] * ratio**2 for curve, ratio in zip(curves, speed_ratio, strict=True))
    if highest_m <= static_head_m:
        return flows(static_head_m)

    def surplus_m3h(head_m):
        return sum(flows(head_m)) - math.sqrt((head_m - static_head_m) / friction_h2_m5)

    return flows(brentq(surplus_m3h, static_head_m, highest_m, xtol=1e-13, rtol=1e-14))


@pytest.mark.parametrize("speed_ratio", [0.2, 0.3, 0.55, 1.0, 1.1])
@pytest.mark.parametrize("curve", [PAPER_CURVE, SMALL_CURVE, FLAT_CURVE, (20.0, -0.1, 0.0)])
@pytest.mark.parametrize("friction_h2_m5", [0.0, 3e-4, 2e-3])
def test_individual_duty_point_against_brentq(curve, speed_ratio, friction_h2_m5):
    def system_head_m(flow_m3h):
        return 2.0 + friction_h2_m5 * flow_m3h**2

    expected = brentq_flow_m3h(curve, speed_ratio, system_head_m)
    (flow_m3h,) = individual_flows([curve], [speed_ratio], 2.0, friction_h2_m5)
    assert flow_m3h == pytest.approx(expected, abs=TOLERANCE_M3H)
    if flow_m3h > 0:
        assert pump_head_m(*curve, speed_ratio, flow_m3h) == pytest.approx(system_head_m(flow_m3h), abs=1e-9)


def test_individual_mains_do_not_know_each_other():
    together = individual_flows([PAPER_CURVE, SMALL_CURVE], [1.0, 0.8], 2.0, 6e-4)
    alone = [
        individual_flows([curve], [ratio], 2.0, 6e-4)[0] for curve, ratio in ((PAPER_CURVE, 1.0), (SMALL_CURVE, 0.8))
    ]
    assert together.tolist() == alone


@pytest.mark.parametrize("pumps", [1, 2, 3, 4, 7])
def test_equal_pumps_on_a_header_against_the_closed_form(pumps):
    c0, c1, c2 = PAPER_CURVE
    a, b, c = 6e-4 * pumps**2 - c2, -c1, 2.0 - c0
    each_m3h = (-b + math.sqrt(b * b - 4 * a * c)) / (2 * a)
    flows = header_flows([PAPER_CURVE] * pumps, [1.0] * pumps, 2.0, 6e-4)
    assert flows == pytest.approx([each_m3h] * pumps, abs=TOLERANCE_M3H)


@pytest.mark.parametrize(
    ("curves", "speed_ratio"),
    [
        ([PAPER_CURVE, SMALL_CURVE], [1.0, 1.0]),
        ([PAPER_CURVE, SMALL_CURVE, FLAT_CURVE], [1.0, 1.0, 1.0]),
        ([PAPER_CURVE, SMALL_CURVE, FLAT_CURVE], [0.9, 1.0, 0.85]),
        ([PAPER_CURVE, PAPER_CURVE, PAPER_CURVE], [1.0, 0.95, 0.0]),
        ([PAPER_CURVE, PAPER_CURVE], [1.0, 0.9]),
        ([SMALL_CURVE, PAPER_CURVE, FLAT_CURVE, PAPER_CURVE], [0.5, 0.7, 1.0, 1.1]),
    ],
)
@pytest.mark.parametrize("friction_h2_m5", [1e-7, 6e-5, 6e-4, 1e-2])
def test_header_against_brentq(curves, speed_ratio, friction_h2_m5):
    expected = brentq_header(curves, speed_ratio, 2.0, friction_h2_m5)
    flows = header_flows(curves, speed_ratio, 2.0, friction_h2_m5)
    assert flows == pytest.approx(expected, abs=TOLERANCE_M3H)


@pytest.mark.parametrize("linear_flow_m3h", [20.0, 400.0])
def test_a_loss_that_is_in_part_linear_against_brentq(linear_flow_m3h):
    """A shared main and a pipe of each pump's own, both with a loss k Q (Q + s)."""
    curves, speed_ratio, own, shared = [PAPER_CURVE, SMALL_CURVE, FLAT_CURVE], [1.0, 0.9, 0.95], 2e-4, 1e-4

    def flows(head_m):
        return [
            brentq_flow_m3h(curve, ratio, lambda flow: head_m + own * flow * (flow + linear_flow_m3h))
            for curve, ratio in zip(curves, speed_ratio, strict=True)
        ]

    def surplus_m(head_m):
        total = sum(flows(head_m))
        return head_m - 2.0 - shared * total * (total + linear_flow_m3h)

    expected = flows(brentq(surplus_m, 2.0, 36.0, xtol=1e-13, rtol=1e-14))
    flow_m3h = header_flows(curves, speed_ratio, 2.0, shared, own_h2_m5=own, linear_flow_m3h=linear_flow_m3h)
    assert flow_m3h == pytest.approx(expected, abs=TOLERANCE_M3H)
    (expected_m3h,) = (
        brentq_flow_m3h(PAPER_CURVE, 1.0, lambda flow: 2.0 + (own + shared) * flow * (flow + linear_flow_m3h)),
    )
    alone = individual_flow_m3h(np.array(PAPER_CURVE), 1.0, 2.0, own + shared, linear_flow_m3h, 0.0, 0.0)
    assert alone == pytest.approx(expected_m3h, abs=TOLERANCE_M3H)
    one = header_flows(curves, [1.0, 0.0, 0.0], 2.0, shared, own_h2_m5=own, linear_flow_m3h=linear_flow_m3h)
    assert one.tolist() == [pytest.approx(expected_m3h, abs=TOLERANCE_M3H), 0.0, 0.0]


@pytest.mark.parametrize("leak_m3h", [0.5, 8.0, 60.0])
@pytest.mark.parametrize("static_head_m", [0.0, 2.0, 12.0])
@pytest.mark.parametrize("speed_ratio", [(1.0, 0.0, 0.0), (1.0, 0.8, 0.0), (0.62, 0.0, 0.0)])
def test_what_runs_back_through_standing_pumps_is_missing_in_the_main(leak_m3h, static_head_m, speed_ratio):
    """With the header's head as the unknown; behind a weak pump the main itself may run back."""
    curves, shared, linear_flow_m3h = [PAPER_CURVE, SMALL_CURVE, FLAT_CURVE], 5e-4, 4.0
    pairs = list(zip(curves, speed_ratio, strict=True))

    def flows(head_m):
        return [brentq_flow_m3h(curve, ratio, lambda _: head_m) if ratio else 0.0 for curve, ratio in pairs]

    def surplus_m(head_m):
        main = sum(flows(head_m)) - leak_m3h * math.sqrt(head_m)
        return head_m - static_head_m - shared * main * (abs(main) + linear_flow_m3h)

    header_m = brentq(surplus_m, 0.0, 80.0, xtol=1e-13, rtol=1e-14)
    more = {"linear_flow_m3h": linear_flow_m3h, "leak_m3h": leak_m3h}
    flow_m3h = header_flows(curves, speed_ratio, static_head_m, shared, **more)
    assert flow_m3h == pytest.approx(flows(header_m), abs=1e-6)
    back_m3h = header_back_flow_m3h(leak_m3h, static_head_m, shared, linear_flow_m3h, flow_m3h.sum())
    assert back_m3h == pytest.approx(leak_m3h * math.sqrt(header_m), abs=1e-6)


def test_duty_points_of_a_station_file_know_its_leaks(quiet_alpha):
    leak, header = EffectTable(name="check_valve_leak", leak_m3h=8.0), EffectTable(name="common_header")
    plain, leaking = (
        duty_flows_m3h(
            effective_parameters(quiet_alpha.model_copy(update={"effect": effects})), np.array([1.0, 0.0, 0.0]), 1.0
        )
        for effects in ((header,), (header, leak))
    )
    assert leaking[0] > plain[0] + 10.0
    assert leaking[1:].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("layout", [individual_flows, header_flows])
def test_without_friction_every_pump_meets_the_static_head(layout):
    flows = layout([FLAT_CURVE, SMALL_CURVE, PAPER_CURVE], [1.0, 0.9, 0.2], 10.0, 0.0)
    assert flows[0] == pytest.approx(math.sqrt((30.0 - 10.0) / 4e-4), abs=TOLERANCE_M3H)
    expected = brentq_flow_m3h(SMALL_CURVE, 0.9, lambda _: 10.0)
    assert flows[1] == pytest.approx(expected, abs=TOLERANCE_M3H)
    assert flows[2] == 0.0


@pytest.mark.parametrize("others", [1, 2])
def test_a_weak_pump_stays_behind_its_closed_check_valve(others):
    """At half speed its shut-off head is 9 m, over the static head of 2 m but under the header's head."""
    strong = [PAPER_CURVE] * others
    flows = header_flows([PAPER_CURVE, *strong], [0.5, *[1.0] * others], 2.0, 6e-4)
    alone = header_flows(strong, [1.0] * others, 2.0, 6e-4)
    header_head_m = 2.0 + 6e-4 * alone.sum() ** 2
    assert 2.0 < 36.0 * 0.5**2 < header_head_m
    assert flows[0] == 0.0
    assert flows[1:] == pytest.approx(alone, abs=TOLERANCE_M3H)


@pytest.mark.parametrize("layout", [individual_flows, header_flows])
def test_standing_pumps_and_pumps_under_the_static_head_give_nothing(layout):
    flows = layout([PAPER_CURVE, PAPER_CURVE], [0.0, math.sqrt(2.0 / 36.0)], 2.0, 6e-4)
    assert flows.tolist() == [0.0, 0.0]


def test_a_backward_flow_is_never_given():
    assert flow_at_head_m3h(*PAPER_CURVE, 1.0, 36.0) == 0.0
    assert flow_at_head_m3h(*PAPER_CURVE, 1.0, 50.0) == 0.0
    assert flow_at_head_m3h(*PAPER_CURVE, 0.0, -1.0) == 0.0


def test_paper_duty_points():
    """ERRATA of the paper: with these coefficients its printed duty points come out, to the digits printed."""
    (clogged,) = individual_flows([PAPER_CURVE], [1.0], 2.0, 6e-4)
    (clean,) = individual_flows([PAPER_CURVE], [1.0], 2.0, 3e-4)
    assert clogged == pytest.approx(200.0, abs=0.05)
    assert pump_head_m(*PAPER_CURVE, 1.0, clogged) == pytest.approx(26.0, abs=0.05)
    assert hydraulic_power_kw(clogged, pump_head_m(*PAPER_CURVE, 1.0, clogged)) == pytest.approx(14.2, abs=0.05)
    assert clean == pytest.approx(254.5, abs=0.05)
    assert pump_head_m(*PAPER_CURVE, 1.0, clean) == pytest.approx(21.4, abs=0.05)


def test_paper_powers():
    """Three-phase power of 400 V, 30 A and 0.9; the current follows the frequency, and stops at five times."""
    assert electrical_power_kw(400.0, 30.0, 0.9, 1.0) == pytest.approx(18.7, abs=0.05)
    assert electrical_power_kw(400.0, 30.0, 0.9, 0.5) == pytest.approx(math.sqrt(3) * 400 * 15 * 0.9 / 1000)
    assert electrical_power_kw(400.0, 30.0, 0.9, 9.0) == electrical_power_kw(400.0, 30.0, 0.9, 5.0)
    assert hydraulic_power_kw(3600.0, 1.0) == pytest.approx(9.81)


def test_duty_table_of_the_paper_station(alpha):
    table = duty_table(alpha)
    assert len(table["each_pump_alone"]) == 3
    for number, row in enumerate(table["each_pump_alone"], start=1):
        assert row["pump"] == number
        assert row["flow_m3h"] == pytest.approx(200.0, abs=0.05)
        assert row["head_m"] == pytest.approx(26.0, abs=0.05)
        assert row["hydraulic_power_kw"] == pytest.approx(14.2, abs=0.05)
        assert row["shaft_power_kw"] == pytest.approx(14.2 / 0.9, abs=0.1)
        assert row["electrical_power_kw"] == pytest.approx(18.7, abs=0.05)
    assert table["total_flow_m3h"] == pytest.approx(600.0, abs=0.1)


def test_duty_table_of_a_header(alpha):
    main = RisingMain(static_head_m=2.0, friction_h2_m5=6e-4, layout="common")
    table = duty_table(alpha.model_copy(update={"rising_main": main}))
    assert table["each_pump_alone"] == duty_table(alpha)["each_pump_alone"]
    expected = brentq_header([PAPER_CURVE] * 3, [1.0] * 3, 2.0, 6e-4)
    assert table["total_flow_m3h"] == pytest.approx(sum(expected), abs=0.02)
    assert table["total_flow_m3h"] < 1.3 * table["each_pump_alone"][0]["flow_m3h"]
