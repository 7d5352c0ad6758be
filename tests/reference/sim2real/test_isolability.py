"""Isolability against brute force: two effects simulated second by second, and the likelihoods of noisy readings.

The reference knows nothing of signatures: it runs the whole station under one effect with noise, and under the other
one without noise at each size of a grid, and asks whether any size explains the readings as well as the truth does.
What `TELLING` stands for, as twice a loss of log-likelihood, separates the answers.
"""

import math

import numpy as np
import pytest

from wetwell.protocols.quantities import SIGNALS, pump_column
from wetwell.protocols.station.station_file import EffectTable, Sensors
from wetwell.sim2real.isolability.causes import causes_of
from wetwell.sim2real.isolability.duty_points import VALUES
from wetwell.sim2real.isolability.isolability import TELLING, isolability
from wetwell.simulator.inflow.recorded import RecordedInflow
from wetwell.simulator.parameters import plant_parameters
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

QUIET = Sensors(flow_noise=0, head_noise=0, power_noise=0, inflow_noise=0, level_noise_m=0)
SETTLED_S = 15
GRIDS = {
    "friction_bias": ("factor", np.linspace(0.5, 2.5, 201)),
    "static_head_bias": ("offset_m", np.linspace(-6.0, 6.0, 201)),
    "pump_wear": ("head_loss", np.linspace(0.0, 0.3, 201)),
    "motor_slip": ("slip", np.linspace(0.0, 0.15, 201)),
    "flow_meter_gain": ("factor", np.linspace(0.8, 1.25, 201)),
}


def readings(station, effect, seconds=1_200, seed=1):
    """Columns of a station with one effect, one pump running most of the time, and which seconds are steady."""
    inflow = RecordedInflow(time_s=[0.0], flow_m3h=[150.0])
    station = station.model_copy(update={"effect": (effect,)})
    scenario = Scenario(name="r", initial_level_m=1.59, inflow=inflow)
    columns = Simulation(station, scenario, seed).advance(seconds, truth=False).columns
    at_nominal = columns["pump1_frequency_hz"] == 50.0
    steady = at_nominal & (np.convolve(at_nominal, np.ones(SETTLED_S), "full")[: at_nominal.size] == SETTLED_S)
    return columns, steady


def misfit(station, truth, other, words):
    """Least of twice the loss of log-likelihood against the truth, over the sizes of the other effect."""
    noisy, steady = readings(station, truth)
    rows = np.flatnonzero(steady)[:VALUES]
    quiet = station.model_copy(update={"sensors": QUIET})
    name, sizes = GRIDS[other]
    noise = {"flow": station.sensors.flow_noise, "head": station.sensors.head_noise}

    def squares(effect):
        clean, is_steady = readings(quiet, effect)
        total = 0.0
        for word in words:
            column = pump_column(1, SIGNALS[word])
            expected = np.median(clean[column][is_steady])
            total += np.sum(((noisy[column][rows] - expected) / (noise[word] * expected)) ** 2)
            total += 2.0 * rows.size * math.log(expected)
        return total

    best = min(squares(EffectTable.model_validate({"name": other, name: size})) for size in sizes.tolist())
    return best - squares(truth)


@pytest.mark.parametrize("words", [("flow",), ("flow", "head")])
@pytest.mark.parametrize(
    ("true", "other"),
    [
        ("friction_bias", "static_head_bias"),
        ("static_head_bias", "friction_bias"),
        ("friction_bias", "pump_wear"),
        ("friction_bias", "flow_meter_gain"),
        ("motor_slip", "pump_wear"),
        ("flow_meter_gain", "motor_slip"),
        ("pump_wear", "motor_slip"),
    ],
)
def test_the_likelihoods_of_simulated_readings_say_the_same(alpha, true, other, words):
    found = isolability(alpha, [SIGNALS[word] for word in words])
    told = {cause.name: cause for cause in found.causes}
    cause = next(cause for cause in causes_of(alpha, plant_parameters(alpha)) if cause.name == true)
    name, _ = GRIDS[true]
    neutral, size = cause.forms[0].neutral[name], getattr(cause.forms[0], name)
    losses = [
        misfit(
            alpha, EffectTable.model_validate({"name": true, name: neutral + sign * (size - neutral)}), other, words
        )
        for sign in cause.signs
    ]
    assert (min(losses) > TELLING**2) == (other not in told[true].same_as)
