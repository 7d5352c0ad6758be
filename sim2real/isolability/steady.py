"""What the meters read at duty points: the plant of the simulator, held there."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.jit import compiled
from wetwell.protocols.quantities import INFLOW, LEVEL, PUMP_METERS, AnalogueQuantity
from wetwell.sim2real.isolability.duty_points import DutyPoint
from wetwell.simulator.faults.profile import Profile
from wetwell.simulator.forcing import Forcing, healthy_forcing
from wetwell.simulator.kernel import move_plant
from wetwell.simulator.parameters import PlantParameters, PlantRecords
from wetwell.simulator.state import PlantState, Truth, first_state, still_truth
from wetwell.simulator.telemetry.channels import channels, channels_of
from wetwell.simulator.telemetry.sending import read_channel, read_pumps
from wetwell.simulator.wet_well import level_at_volume_m, volume_at_level_m3

HOLD_S = 30
"""How long the plant is held at a duty point: slip and torque find each other within seconds. [s]"""
HOUR_S = 3600.0
SMALL_M3 = 1e-3
"""Volume by which the area at a level is taken: small beside what a wet well holds. [m³]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class SteadyValues:
    """Readings without noise at each of n duty points.

    Attributes
    ----------
    pumps : dict of quantity to (pumps, n) array
        Flow, head and power as their meters read.
    inflow_m3h : (n,) array
        As its meter reads. [m³/h]
    level_rate_m_h : (n,) array
        How fast the level rises. [m/h]
    area_m2 : (n,) array
        Of the wet well. [m²]
    """

    pumps: dict[AnalogueQuantity, Floats]
    inflow_m3h: Floats
    level_rate_m_h: Floats
    area_m2: Floats


def steady_values(
    plant: PlantParameters, points: Sequence[DutyPoint], faults: Sequence[Profile] = ()
) -> SteadyValues:
    """Hold a plant at duty points, one after the other.

    Parameters
    ----------
    plant : PlantParameters
    points : sequence of DutyPoint
    faults : sequence of faults
        Each is there in full from the first second on.
    """
    count = len(plant.pumps)
    quiet = tuple(
        replace(
            sensor, noise=0.0, delay_s=0.0, quantum=0.0, deadband=0.0, followed=1.0, followed_again=1.0, carried=0.0
        )
        for sensor in plant.sensors
    )
    plant = replace(plant, sensors=quiet)
    records = plant.records()
    seconds = HOLD_S * len(points)
    frequency_hz = np.repeat(np.array([point.frequency_hz for point in points]).T, HOLD_S, axis=1)
    level_m = np.repeat([point.level_m for point in points], HOLD_S)
    volume_m3 = np.array([volume_at_level_m3(level, records.profile) for level in level_m.tolist()])
    inflow_m3h = np.repeat([point.inflow_m3h for point in points], HOLD_S)
    forcing = healthy_forcing(inflow_m3h, count, len(plant.mains), with_sensors=True)
    for fault in faults:
        fault.apply(forcing, np.arange(seconds, dtype=np.float64))  # type: ignore[attr-defined]
    measured = np.zeros((channels(count), seconds))
    state = first_state(plant, points[0].level_m)
    net_m3 = np.empty(seconds)
    rng = np.random.default_rng(0)
    hold_seconds(records, state, forcing, frequency_hz, volume_m3, rng, measured, still_truth(count, seconds), net_m3)
    last = slice(HOLD_S - 1, None, HOLD_S)
    before_m3, net_m3 = volume_m3[last], net_m3[last]
    rise_m = [
        level_at_volume_m(volume + net, records.profile) - level_at_volume_m(volume, records.profile)
        for volume, net in zip(before_m3.tolist(), net_m3.tolist(), strict=True)
    ]
    small_m = [
        level_at_volume_m(volume + SMALL_M3, records.profile) - level_at_volume_m(volume, records.profile)
        for volume in before_m3.tolist()
    ]
    return SteadyValues(
        pumps={name: measured[channels_of(name, count), last] for name in PUMP_METERS},
        inflow_m3h=measured[INFLOW, last],
        level_rate_m_h=np.array(rise_m) * HOUR_S,
        area_m2=SMALL_M3 / np.array(small_m),
    )


@compiled
def hold_seconds(
    plant: PlantRecords,
    state: PlantState,
    forcing: Forcing,
    frequency_hz: Floats,
    volume_m3: Floats,
    rng: np.random.Generator,
    measured: Floats,
    truth: Truth,
    net_m3: Floats,
) -> None:
    """Move and read a plant whose frequencies and volume are set in each second.

    Parameters
    ----------
    plant, state, forcing, rng, measured, truth
        As in the simulator's kernel.
    frequency_hz : (pumps, n) array
        [Hz]
    volume_m3 : (n,) array
        [m³]
    net_m3 : (n,) array
        Out: what the wet well gains in each second. [m³]
    """
    now = state.station[0]
    for second in range(volume_m3.size):
        now.volume_m3 = volume_m3[second]
        for i in range(state.pumps.size):
            state.pumps[i].frequency_hz = frequency_hz[i, second]
        move_plant(plant, state, forcing, second, 0.0, truth, second)
        net_m3[second] = now.volume_m3 - volume_m3[second]
        read_channel(LEVEL, truth.level_m[second], True, False, plant, state, forcing, second, rng, measured)
        read_channel(INFLOW, forcing.inflow_m3h[second], True, False, plant, state, forcing, second, rng, measured)
        read_pumps(False, False, plant, state, forcing, second, rng, truth, measured)
        now.second += 1
