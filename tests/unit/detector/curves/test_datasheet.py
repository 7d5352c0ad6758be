"""Duty flows by the datasheet against a solver that shares no code with them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from wetwell.detector.curves.datasheet import Datasheet, SystemCurve, duty_flows
from wetwell.detector.stream.run_state import new_pumps

STATIC_M, FRICTION = 2.0, 6.0e-4


def nominal_with(curves, *, is_common_header):
    return Datasheet(
        curves=curves,
        frequencies_hz=(50.0,) * len(curves),
        mains=(SystemCurve(static_head_m=STATIC_M, friction_h2_m5=FRICTION, is_common_header=is_common_header),),
        main_of_pump=(0,) * len(curves),
        area_m2=8.0,
        middle_level_m=1.0,
    )


def flows_at(datasheet, speeds, level_m=np.nan):
    pumps = new_pumps(datasheet)
    pumps["duty_speed"] = speeds
    duty_flows(datasheet.table(), pumps, level_m)
    return pumps["duty_m3h"]


def on_its_curve(curve, speed, head_m):
    c0, c1, c2 = curve
    lift_m = c0 * speed**2 - head_m
    return max(np.roots([c2, c1 * speed, lift_m]).real) if lift_m > 0.0 else 0.0


@pytest.mark.parametrize("seed", range(40))
def test_pumps_on_a_common_header_meet_at_the_head_of_the_main(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    curves = tuple((rng.uniform(10.0, 60.0), -rng.uniform(0.0, 0.05), -rng.uniform(1e-5, 5e-4)) for _ in range(count))
    speeds = np.where(rng.random(count) < 0.3, 0.0, rng.uniform(0.3, 1.2, count))

    def lacking_m(head_m):
        total = sum(on_its_curve(curve, speed, head_m) for curve, speed in zip(curves, speeds, strict=True))
        return STATIC_M + FRICTION * total**2 - head_m

    head_m = brentq(lacking_m, STATIC_M, 200.0, xtol=1e-12)
    expected = [on_its_curve(curve, speed, head_m) for curve, speed in zip(curves, speeds, strict=True)]
    found = flows_at(nominal_with(curves, is_common_header=True), speeds)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-4)


@pytest.mark.parametrize("is_common_header", [False, True])
def test_a_pump_alone_meets_the_main_by_itself_and_one_that_cannot_lift_gives_nothing(is_common_header):
    curve = (36.0, -0.01, -2.0e-4)
    flow, standing, weak = flows_at(nominal_with((curve,) * 3, is_common_header=is_common_header), [0.9, 0.0, 0.2])
    assert (standing, weak) == (0.0, 0.0)
    assert 36.0 * 0.81 - 0.009 * flow - 2.0e-4 * flow**2 == pytest.approx(STATIC_M + FRICTION * flow**2, abs=1e-9)


def test_each_main_is_solved_by_itself_and_a_delivery_level_is_counted_from_the_water():
    curves = ((36.0, -0.01, -2.0e-4), (30.0, -0.02, -1.0e-4)) * 2
    header = SystemCurve(static_head_m=STATIC_M, friction_h2_m5=FRICTION, is_common_header=True)
    lifted = SystemCurve(static_head_m=12.0, friction_h2_m5=3.0e-4, is_common_header=True, level_slope=1.0)
    both = replace(nominal_with(curves, is_common_header=True), mains=(header, lifted), main_of_pump=(0, 1, 1, 0))
    speeds = np.array([1.0, 0.9, 0.95, 0.8])
    found = flows_at(both, speeds, 1.5)
    alone = nominal_with((curves[0], curves[3]), is_common_header=True)
    np.testing.assert_array_equal(found[[0, 3]], flows_at(alone, speeds[[0, 3]]))
    fixed = SystemCurve(static_head_m=10.5, friction_h2_m5=3.0e-4, is_common_header=True)
    alone = replace(nominal_with((curves[1], curves[2]), is_common_header=True), mains=(fixed,))
    np.testing.assert_array_equal(found[[1, 2]], flows_at(alone, speeds[[1, 2]]))
