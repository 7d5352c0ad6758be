"""Faults of pumps, rising main, sensors and PLC, as profiles over time. The registry is the union itself."""

from typing import Annotated, get_args

from pydantic import Field

from wetwell.simulator.faults.air_pocket import AirPocket
from wetwell.simulator.faults.blockage import Blockage
from wetwell.simulator.faults.check_valve_leak import CheckValveLeak
from wetwell.simulator.faults.drive_trip import DriveTrip
from wetwell.simulator.faults.frozen_plc import FrozenPlc
from wetwell.simulator.faults.impeller_wear import ImpellerWear
from wetwell.simulator.faults.partly_closed_valve import PartlyClosedValve
from wetwell.simulator.faults.pipe_clogging import PipeClogging
from wetwell.simulator.faults.ragging import Ragging
from wetwell.simulator.faults.sensor_bias import SensorBias
from wetwell.simulator.faults.sensor_drift import SensorDrift
from wetwell.simulator.faults.sensor_noise import SensorNoise
from wetwell.simulator.faults.sensor_stuck import SensorStuck
from wetwell.simulator.faults.wear_ring_leakage import WearRingLeakage

Fault = Annotated[
    Blockage
    | ImpellerWear
    | WearRingLeakage
    | Ragging
    | CheckValveLeak
    | DriveTrip
    | PipeClogging
    | PartlyClosedValve
    | AirPocket
    | SensorStuck
    | SensorDrift
    | SensorBias
    | SensorNoise
    | FrozenPlc,
    Field(discriminator="kind"),
]
FAULTS = {fault.model_fields["kind"].default: fault for fault in get_args(get_args(Fault)[0])}
