"""Water that runs back through standing pumps of a header, in each plant that stands for reality, by the balance.

Tolerances: 1 % of the flow, as SWMM's dynamic wave and Colebrook's friction differ from k Q² by some thousandths.
"""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from wetwell.services.trial.plants import passage_of
from wetwell.sim2real.truth.case import Deviation, TrueInflow, TruthCase

STEADY = TrueInflow(mean_m3h=90.0, swing=0.0, noise=0.0, rain_per_day=0.0)
C0, C1, C2 = 36.0, -0.02333, -1.3333e-4
STATIC_M, FRICTION_H2_M5 = 2.0, 6e-4
LEAK_M3H = 8.0


def main_flow_m3h(standing):
    """Flow of the main of one running pump, less what runs back through the others."""

    def excess_m(main_m3h):
        header_m = STATIC_M + FRICTION_H2_M5 * main_m3h**2
        pumped_m3h = main_m3h + standing * LEAK_M3H * math.sqrt(header_m)
        return C0 + C1 * pumped_m3h + C2 * pumped_m3h**2 - header_m

    return brentq(excess_m, 0.0, 500.0)


@pytest.mark.parametrize("plant", ["fine", "swmm", "elastic"])
def test_a_running_pump_carries_what_runs_back_through_the_others_too(quiet_alpha, plant):
    main = quiet_alpha.rising_main.model_copy(update={"layout": "common"})
    station = quiet_alpha.model_copy(
        update={"rising_main": main, "control": quiet_alpha.control.model_copy(update={"ramp_s": 2.0})}
    )
    leak = Deviation(name="check_valve_leak", parameters={"leak_m3h": LEAK_M3H})
    columns = (
        passage_of(TruthCase(station=station, deviations=(leak,), inflow=STEADY, seconds=7200), plant)
        .oracle()
        .columns
    )
    frequency_hz = np.array([columns[f"pump{i}_frequency_hz"] for i in (1, 2, 3)])
    alone = (frequency_hz[0] == 50.0) & (frequency_hz[1:] == 0.0).all(axis=0)
    settled = alone & np.roll(alone, 20)
    assert settled.sum() > 30
    main_m3h = main_flow_m3h(standing=2)
    header_m = STATIC_M + FRICTION_H2_M5 * main_m3h**2
    pumped_m3h = main_m3h + 2 * LEAK_M3H * math.sqrt(header_m)
    assert pumped_m3h > 1.15 * main_flow_m3h(standing=0)
    assert np.median(columns["pump1_flow_m3h"][settled]) == pytest.approx(pumped_m3h, rel=0.01)
    assert np.median(columns["pump1_head_m"][settled]) == pytest.approx(header_m, rel=0.02)
