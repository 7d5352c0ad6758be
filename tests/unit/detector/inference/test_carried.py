"""A run held against the faults that were there before it."""

import numpy as np
import pytest

from wetwell.detector.curves.sensor_signatures import flow_meter_direction, head_sensor_direction
from wetwell.detector.inference.carried import carry
from wetwell.detector.inference.observation import Observation
from wetwell.detector.inference.posterior import BOTH, NORMAL, PUMP_FAULT, SYSTEM_FAULT, Scales, posterior_of
from wetwell.detector.inference.prior import CHANGE_PER_RUN, PumpPrior, SystemPrior, joint_prior
from wetwell.protocols.timestamps import NS_PER_S

SCALES = Scales(pump_m=5.4, system_m=8.2, head_m=3.6)
FLOOR = np.eye(2) * 0.036**2
FRICTION_M = 24.0
RUN_NS = 900 * NS_PER_S


def seen(shift_m, slope_m=(0.0, 0.0), system_in_pump=0.0):
    direction = flow_meter_direction(200.0, 200.0, 200.0, (36.0, -0.02333, -1.3333e-4), 6.0e-4)
    return Observation(
        mean=np.array([*shift_m, 0.0, np.nan]),
        covariance=np.diag([0.05**2, 0.05**2, 0.004**2, 0.01**2]),
        slope_variance=np.square(slope_m),
        flow_meter=np.array([*direction, 1.0, 0.0]),
        head_sensor=np.array([*head_sensor_direction(1.0), 0.0, 0.0]),
        system_in_pump=system_in_pump,
    )


def believed(pump_m=None, rise=None, runs=20):
    """Beliefs after runs that showed a loss of head and a rise of friction."""
    pump, system = PumpPrior(), SystemPrior()
    for prior, size, scale, floor in (
        (pump, pump_m, SCALES.pump_m, 0.036),
        (system, rise, SCALES.system_m / FRICTION_M, 0.036 / FRICTION_M),
    ):
        for number in range(runs):
            value, variance = size or 0.0, (0.05 * scale / SCALES.pump_m) ** 2
            prior.asset.track.update(number * RUN_NS, value, variance, scale, floor**2, CHANGE_PER_RUN, is_sure=True)
    pump.pump = 0.95 if pump_m else 0.0026
    system.system = 0.95 if rise else 0.0026
    system.asset.friction_m = FRICTION_M
    return pump, system


def weighed(observation, pump, system, friction_m=FRICTION_M):
    prior, carried = carry(pump, system, observation, SCALES, FLOOR, friction_m, 20 * RUN_NS)
    return posterior_of(observation, SCALES, prior, carried).probability


def test_a_pump_that_is_cleared_while_the_main_clogs_is_told_at_once():
    pump, system = believed(pump_m=6.4, rise=0.12)
    run = seen((-0.007, 0.14 * FRICTION_M), slope_m=(0.5, 0.5))
    without = posterior_of(run, SCALES, joint_prior(pump, system)).probability
    assert without[BOTH] > 0.3, "that there was a fault says that there is one, without its size"
    assert weighed(run, pump, system)[SYSTEM_FAULT] > 0.95


def test_a_fault_that_stays_or_grows_stays():
    pump, system = believed(pump_m=0.4)
    for shift_m in (-0.4, -0.5):
        assert weighed(seen((shift_m, 0.0)), pump, system)[PUMP_FAULT] > 0.99
    pump, system = believed(rise=0.1)
    for rise in (0.1, 0.105):
        assert weighed(seen((0.0, rise * FRICTION_M)), pump, system)[SYSTEM_FAULT] > 0.99


def test_a_fault_of_another_size_is_a_fault():
    pump, system = believed(pump_m=6.4)
    assert weighed(seen((-1.5, 0.0)), pump, system)[PUMP_FAULT] > 0.99


def test_what_has_gone_bit_by_bit_is_not_told_for_ever():
    pump, system = believed(pump_m=0.0)
    pump.pump = 0.95
    for _ in range(4):
        probability = weighed(seen((0.0, 0.0)), pump, system)
        pump.pump = 0.95 * float(probability[PUMP_FAULT] + probability[BOTH]) + 0.0025
    assert probability[NORMAL] > 0.9


@pytest.mark.parametrize("friction_m", [FRICTION_M, 2.5 * FRICTION_M])
def test_at_another_flow_a_main_is_expected_between_friction_and_lift(friction_m):
    pump, system = believed(rise=0.1)
    for shift_m in (0.1 * FRICTION_M, 0.1 * friction_m):
        assert weighed(seen((0.0, shift_m)), pump, system, friction_m)[SYSTEM_FAULT] > 0.99


@pytest.mark.parametrize("error", [-0.015, 0.015])
def test_what_a_flow_meter_that_wanders_makes_of_health_is_no_size_to_carry(error):
    run = seen((0.0, 0.0))
    pump_m, system_m = error * run.flow_meter[:2]
    pump, system = believed(pump_m=-pump_m, rise=system_m / FRICTION_M)
    _, carried = carry(pump, system, run, SCALES, FLOOR, FRICTION_M, 20 * RUN_NS)
    assert carried.share.max() < 0.05
    pump, system = believed(pump_m=-3.0 * pump_m, rise=3.0 * system_m / FRICTION_M)
    _, carried = carry(pump, system, run, SCALES, FLOOR, FRICTION_M, 20 * RUN_NS)
    assert carried.share.min() > 0.9


def test_without_a_head_sensor_nothing_is_carried():
    pump, system = believed(pump_m=6.4)
    prior, carried = carry(pump, system, seen((0.0, np.nan), system_in_pump=-1.0), SCALES, FLOOR, FRICTION_M, RUN_NS)
    assert carried is None
    assert prior == pytest.approx(joint_prior(pump, system))
