"""Isolability against brute force: two effects simulated second by second, and the likelihoods of noisy readings.

The reference knows nothing of signatures: it runs the whole station under one effect with noise, and under the other
one without noise at each size of a grid, and asks whether any size explains the readings as well as the truth does.
What `TELLING` stands for, as twice a loss of log-likelihood, separates the answers. The inflow is constant and known.
"""

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
INFLOW_M3H = 90.0
GRIDS = {
    "friction_bias": ("factor", np.linspace(0.5, 2.5, 201)),
    "static_head_bias": ("offset_m", np.linspace(-6.0, 6.0, 201)),
    "pump_wear": ("head_loss", np.linspace(0.0, 0.3, 201)),
    "motor_slip": ("slip", np.linspace(0.0, 0.15, 201)),
    "flow_meter_gain": ("factor", np.linspace(0.8, 1.25, 201)),
    "unmetered_inflow": ("flow_m3h", np.linspace(0.0, 40.0, 201)),
}


def simulated(station, effect):
    """Columns of twenty minutes of a station with one effect."""
    inflow = RecordedInflow(time_s=[0.0], flow_m3h=[INFLOW_M3H])
    station = station.model_copy(update={"effect": (effect,)})
    scenario = Scenario(name="r", initial_level_m=1.59, inflow=inflow)
    return Simulation(station, scenario, 1).advance(1_200, truth=False).columns


def steady_rows(columns, frequency_hz):
    """First rows of the longest stay of pump 1 at a frequency while the others stand, once it has settled."""
    here = (columns["pump1_frequency_hz"] == frequency_hz) & (columns["pump2_frequency_hz"] == 0.0)
    ends = np.flatnonzero(np.diff(np.r_[False, here, False].astype(int))).reshape(-1, 2)
    first, end = max(ends.tolist(), key=lambda stay: stay[1] - stay[0])
    return np.arange(first + SETTLED_S, end)[:VALUES]


def figures(columns, words, sensors):
    """What is read, and its noise: means while pump 1 runs, slopes of the level while it runs and stands."""
    found = []
    noise = {"flow": sensors.flow_noise, "head": sensors.head_noise}
    running, idle = steady_rows(columns, 50.0), steady_rows(columns, 0.0)
    for word in words:
        if word == "level":
            for rows in (running, idle):
                slope = np.polyfit(rows - rows.mean(), columns["level_m"][rows], 1)[0]
                found.append((slope, np.sqrt(12.0) * sensors.level_noise_m / rows.size**1.5))
        else:
            mean = columns[pump_column(1, SIGNALS[word])][running].mean()
            found.append((mean, noise[word] * mean / np.sqrt(running.size)))
    return np.array(found).T


def loss(station, truth, other, words):
    """Least of twice the loss of log-likelihood against the truth, over the sizes of the other effect."""
    quiet = station.model_copy(update={"sensors": QUIET})
    seen, noise = figures(simulated(station, truth), words, station.sensors)
    name, sizes = GRIDS[other]

    def squares(effect):
        expected, _ = figures(simulated(quiet, effect), words, QUIET)
        return float(np.sum(((seen - expected) / noise) ** 2))

    best = min(squares(EffectTable.model_validate({"name": other, name: size})) for size in sizes.tolist())
    return best - squares(truth)


@pytest.mark.parametrize(
    ("words", "true", "other"),
    [
        (("flow",), "friction_bias", "static_head_bias"),
        (("flow",), "friction_bias", "pump_wear"),
        (("flow",), "flow_meter_gain", "motor_slip"),
        (("flow", "head"), "friction_bias", "static_head_bias"),
        (("flow", "head"), "static_head_bias", "pump_wear"),
        (("flow", "head"), "pump_wear", "motor_slip"),
        (("flow", "head"), "flow_meter_gain", "friction_bias"),
        (("flow", "level"), "flow_meter_gain", "pump_wear"),
        (("flow", "level"), "friction_bias", "motor_slip"),
        (("level",), "friction_bias", "motor_slip"),
        (("level",), "unmetered_inflow", "friction_bias"),
        (("flow", "level"), "static_head_bias", "unmetered_inflow"),
    ],
)
def test_the_likelihoods_of_simulated_readings_say_the_same(alpha, words, true, other):
    metered = [SIGNALS[word] for word in words] + ["inflow_m3h"]
    told = {cause.name: cause for cause in isolability(alpha, metered).causes}
    assert told[true].is_visible
    assert told[other].is_visible
    cause = next(cause for cause in causes_of(alpha, plant_parameters(alpha)) if cause.name == true)
    name, _ = GRIDS[true]
    neutral, size = cause.forms[0].neutral[name], getattr(cause.forms[0], name)
    losses = [
        loss(alpha, EffectTable.model_validate({"name": true, name: neutral + sign * (size - neutral)}), other, words)
        for sign in cause.signs
    ]
    assert (min(losses) > TELLING**2) == (other not in told[true].same_as)
