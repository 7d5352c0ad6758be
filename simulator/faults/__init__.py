"""Faults of pumps, rising main, sensors and PLC, as profiles over time. The registry is the union itself."""

from typing import Annotated, get_args

from pydantic import Field

from wetwell.simulator.faults.pump.blockage import Blockage
from wetwell.simulator.faults.pump.check_valve_leak import CheckValveLeak
from wetwell.simulator.faults.pump.drive_trip import DriveTrip
from wetwell.simulator.faults.pump.impeller_wear import ImpellerWear
from wetwell.simulator.faults.pump.ragging import Ragging
from wetwell.simulator.faults.pump.wear_ring_leakage import WearRingLeakage
from wetwell.simulator.faults.rising_main.air_pocket import AirPocket
from wetwell.simulator.faults.rising_main.partly_closed_valve import PartlyClosedValve
from wetwell.simulator.faults.rising_main.pipe_clogging import PipeClogging
from wetwell.simulator.faults.telemetry.frozen_plc import FrozenPlc
from wetwell.simulator.faults.telemetry.sensor_bias import SensorBias
from wetwell.simulator.faults.telemetry.sensor_drift import SensorDrift
from wetwell.simulator.faults.telemetry.sensor_noise import SensorNoise
from wetwell.simulator.faults.telemetry.sensor_stuck import SensorStuck

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
