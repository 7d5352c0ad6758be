"""Duty flows by the datasheet against a solver that shares no code with them."""

import numpy as np
import pytest
from scipy.optimize import brentq

from wetwell.detector.curves.datasheet import Datasheet, duty_flows
from wetwell.detector.stream.run_state import new_pumps

STATIC_M, FRICTION = 2.0, 6.0e-4


def nominal_with(curves, *, is_common_header):
    return Datasheet(
        curves=curves,
        frequencies_hz=(50.0,) * len(curves),
        static_head_m=STATIC_M,
        friction_h2_m5=FRICTION,
        is_common_header=is_common_header,
        area_m2=8.0,
    )


def flows_at(datasheet, speeds):
    pumps = new_pumps(datasheet)
    pumps["duty_speed"] = speeds
    duty_flows(datasheet.table(), pumps)
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
