"""The level at which something was switched, where one of the two is recorded late."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.sim2real.replay.replay import Prediction
from wetwell.sim2real.replay.stretches import WINDOW_S, Stretches
from wetwell.sim2real.residuals.bins import START_LEVEL, Bins
from wetwell.sim2real.residuals.events import EventResiduals
from wetwell.simulator.parameters import plant_parameters

TURN_S = 100


def stretches(second):
    """Before an event, of a level that rises by 2 mm/s until it turns, and falls by 5 mm/s from there on."""
    time_s = np.arange(200.0) - TURN_S
    counted = np.array([np.arange(second - WINDOW_S + 1, second + 1)])
    return Stretches(
        second=np.array([second]),
        counted=counted,
        is_counted=np.ones(counted.shape, dtype=bool),
        level_m=1.6 + np.where(time_s < 0.0, 0.002 * time_s, -0.005 * time_s),
    )


@pytest.mark.parametrize(("late_s", "shift_s"), [(0, 0.0), (12, -12.0), (-7, 7.0), (20, -20.5)])
def test_the_level_is_that_of_the_moment_whichever_record_is_late(late_s, shift_s):
    level_m, slope_m_s = stretches(TURN_S + late_s).lines(shift_s)
    assert level_m == pytest.approx(1.6 + 0.002 * (late_s + shift_s), abs=1e-12)
    assert slope_m_s == pytest.approx(0.002, abs=1e-12)


def test_a_shift_beyond_the_recording_goes_on_with_the_line():
    level_m, slope_m_s = stretches(TURN_S).lines(-150.0)
    assert (level_m, slope_m_s) == (pytest.approx(1.6 - 0.3), pytest.approx(0.002))


def test_a_stretch_with_few_values_has_no_line():
    short = stretches(TURN_S)
    short.is_counted[:, :-3] = False
    assert np.isnan(short.lines()[1]).all()


@pytest.mark.parametrize(
    ("delay_s", "since_s", "above_m", "is_excused"),
    [(28.0, 29, 0.3, True), (28.0, 60, 0.3, False), (28.0, 29, -0.3, False), (0.0, 1, 0.3, False)],
)
def test_a_timer_may_begin_after_the_event_before(alpha, delay_s, since_s, above_m, is_excused):
    """Then the level is past its threshold already, though not short of it."""
    start, plant = stretches(TURN_S), replace(plant_parameters(alpha), control_delay_s=delay_s)
    one = np.ones(1)
    residuals = EventResiduals(
        bins=Bins(
            **dict.fromkeys(("regime", "cycle", "pump", "second"), np.zeros(1, dtype=np.int64)),
            **dict.fromkeys(("deviation", "floor", "tolerance", "material"), one),
            signal=np.array([START_LEVEL]),
        ),
        number=np.array([0]),
        since_s=np.array([since_s]),
        stretches=replace(start, level_m=start.level_m - 1.6 + plant.start_levels_m[0] + above_m),
        noise_m=0.002,
        pattern=None,
    )
    residual = residuals.of(Prediction(level_m=one, signals={}, plant=plant))[0]
    assert residual == pytest.approx(
        0.0 if is_excused else above_m - 0.002 * delay_s, abs=0.0 if is_excused else 0.01
    )
