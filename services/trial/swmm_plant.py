"""The second truth plant: EPA SWMM 5 moves the water, a PLC written here starts and stops its pumps.

SWMM keeps one model a process, so runs wait for each other.
"""

import math
import tempfile
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.errors import WetwellError
from wetwell.protocols.orders import first_place, go_on, orders_of
from wetwell.protocols.recordings.recording import Recording
from wetwell.sim2real.recording.seconds import since_changes
from wetwell.sim2real.truth import kernel
from wetwell.sim2real.truth.case import TruthCase
from wetwell.sim2real.truth.parts import Truth
from wetwell.sim2real.truth.spec import Spec
from wetwell.sim2real.truth.swmm_input import ROUTING_STEP_S, SWMM_LIBRARY, SWMM_OPEN, swmm_input
from wetwell.sim2real.truth.truth_plant import Passage, truth_of

_ONE_AT_A_TIME = threading.Lock()
_SHUT = 1e-6
"""Flow under which a check valve counts as shut. [m³/s]"""
_STEPS = round(1.0 / ROUTING_STEP_S)
STEADY_S = 20
"""After so long at the same speeds the water moves evenly: its mains settle within a second. [s]"""
LOST = 0.1
"""Share of the shut-off head by which SWMM's heads are off where it has lost the solution: of 61 stations one was off
by 1.0, the others by .003 at the most. [1]"""


class SolutionLostError(WetwellError):
    """SWMM's flows and heads do not belong together: its iteration swings between two steps, or a pump is stuck."""


@dataclass(slots=True)
class _Plc:
    """Starts and stops by level, in rotation, with on- and off-delay."""

    spec: Spec
    running: list[int] = field(default_factory=list)
    turn: int = 0
    over_s: float = 0.0
    under_s: float = 0.0

    def obey(self, speed_ratio: Floats) -> None:
        """Run those pumps that an operator wants to run."""
        wanted = [int(i) for i in np.flatnonzero(speed_ratio)]
        self.running = [i for i in self.running if i in wanted] + [i for i in wanted if i not in self.running]
        self.over_s = self.under_s = 0.0

    def scan(self, level_m: float) -> None:
        count, pumps = len(self.running), self.spec.shutoff_m.size
        is_over = count < self.spec.start_m.size and level_m >= self.spec.start_m[count]
        is_under = count > 0 and level_m <= self.spec.stop_m[count - 1]
        self.over_s = self.over_s + 1.0 if is_over else 0.0
        self.under_s = self.under_s + 1.0 if is_under else 0.0
        if is_over and self.over_s > self.spec.timer_s:
            chosen = next(
                (self.turn + k) % pumps for k in range(pumps) if (self.turn + k) % pumps not in self.running
            )
            self.running.append(chosen)
            self.turn, self.over_s = (chosen + 1) % pumps, 0.0
        elif is_under and self.under_s > self.spec.timer_s:
            self.running.pop()
            self.under_s = 0.0


def run_swmm(case: TruthCase, *, truth: bool = True) -> Recording:
    """Recording of a case with the water moved by SWMM; as `truth_plant.run`, raises as `swmm_passage_of`."""
    return swmm_passage_of(case).recording(truth=truth)


def swmm_passage_of(case: TruthCase) -> Passage:
    """SWMM's passage through a case.

    Raises
    ------
    WetwellError
        If pyswmm is not installed; `SolutionLostError` if SWMM has lost the solution.
    ValueError
        If SWMM cannot express a deviation or a fault of the case.
    """
    try:
        import pyswmm  # noqa: PLC0415 - an extra: only trials with SWMM need it
    except ImportError as error:
        raise WetwellError("the truth plant 'swmm' needs pyswmm: pip install '.[trial]'") from error
    for deviation in case.deviations:
        if deviation.name not in SWMM_LIBRARY + SWMM_OPEN:
            raise ValueError(f"deviation '{deviation.name}' is not one that SWMM can express")
    if case.faults:
        raise ValueError("a case for SWMM can have no faults")
    if any(step.is_valve_shut for step in case.steps):
        raise ValueError("a case for SWMM can have no step with the valves shut")
    made, sensor_rng = truth_of(case)
    station_record = np.empty((2, case.seconds))
    pump_record = np.empty((5, len(case.station.pump), case.seconds))
    step_record = np.empty(case.seconds, dtype=np.int64)
    with _ONE_AT_A_TIME, tempfile.TemporaryDirectory(prefix="swmm-") as room:
        path = Path(room) / "station.inp"
        path.write_text(swmm_input(made.spec, case.initial_level_m), encoding="ascii")
        with pyswmm.Simulation(str(path)) as simulation:
            _drive(
                simulation,
                pyswmm.Nodes(simulation),
                pyswmm.Links(simulation),
                made,
                case,
                station_record,
                pump_record,
                step_record,
            )
    off = float(_off_the_main(made.spec, station_record[kernel.LEVEL], pump_record).max(initial=0.0))
    if off > LOST:
        raise SolutionLostError(
            f"SWMM has lost the solution: in steady running a head is off by {off:.2f} of the shut-off head, "
            f"allowed {LOST}"
        )
    return Passage(
        case=case,
        made=made,
        sensor_rng=sensor_rng,
        station_record=station_record,
        pump_record=pump_record,
        step_record=step_record,
    )


def _drive(
    simulation: Any,
    nodes: Any,
    links: Any,
    made: Truth,
    case: TruthCase,
    station_record: Floats,
    pump_record: Floats,
    step_record: Integers,
) -> None:
    """Drive SWMM step by step, as PLC, drives and weather, and note each whole second."""
    spec, around = made.spec, made.around
    pumps, seconds = spec.shutoff_m.size, around.loss_factor.size
    well = nodes["WELL"]
    machines = [links[f"PUMP{i}"] for i in range(1, pumps + 1)]
    joints = [nodes[f"JOINT{i}" if spec.own_loss > 0 else "HEADER"] for i in range(1, pumps + 1)]
    outlets = [nodes["OUT"]] if spec.shared_loss > 0 else [nodes[f"OUT{i}"] for i in range(1, pumps + 1)]
    plc = _Plc(spec)
    command, speeds, damped = np.zeros(pumps), np.zeros(pumps), np.zeros(pumps)
    orders, place = orders_of(case.steps, pumps), first_place()
    level_m = seen_m = case.initial_level_m
    lift_m = spec.lift_m  # SWMM's own is 0 until its first step
    level_share, flow_share = (_followed(lag_s) for lag_s in (spec.level_lag_s, spec.flow_lag_s))
    simulation.start()
    for second in range(seconds):
        flows = np.array([machine.flow for machine in machines])
        dead_end_m = spec.head_factor * spec.shutoff_m * speeds**2  # behind a check valve that is shut
        lifted_m = np.array([joint.head for joint in joints]) - level_m
        heads_m = np.where(command > 0.0, np.where(flows > _SHUT, lifted_m, dead_end_m), 0.0)
        reading_m = seen_m + around.level_error_m[second]
        station_record[:, second] = level_m, reading_m
        power = spec.rated_power_w * command * around.voltage_factor[second]
        pump_record[:, :, second] = command, flows, np.maximum(heads_m, 0.0), power, damped
        step_record[second] = place[2]
        inlet = 0.0 if place[2] >= 0 and orders.is_inlet_shut[place[2]] else 1.0
        ordered, wanted = go_on(orders, place, float(reading_m)), np.ones(pumps)
        if ordered >= 0 and orders.is_by_hand[ordered]:
            wanted = orders.speed_ratio[ordered]
            plc.obey(wanted)
        else:
            plc.scan(float(reading_m))
        swing = 1.0 + spec.hunting * math.sin(2.0 * math.pi * second / spec.hunting_s)
        inflow = 0.5 * inlet * (around.inflow[second] + around.inflow[second + 1]) + spec.hidden_inflow
        standing = sum(flow <= 0.0 and speed <= 0.0 for flow, speed in zip(flows, command, strict=True))
        behind_m = nodes["HEADER"].head - level_m if spec.shared_loss > 0 else lift_m
        back = standing * spec.flap_leak * math.sqrt(max(behind_m, 0.0))
        well.generated_inflow(inflow + back)
        if spec.shared_loss > 0 and spec.flap_leak > 0.0:
            nodes["HEADER"].generated_inflow(-back)
        for _ in range(_STEPS):
            for i, machine in enumerate(machines):
                aim, reach = wanted[i] if i in plc.running else 0.0, ROUTING_STEP_S / spec.ramp_s
                moved = min(max(aim, command[i] - reach), command[i] + reach)
                command[i] = 0.0 if moved < 1e-9 else moved
                speeds[i] = kernel.shaft_ratio(command[i], spec.ramp_bow) * swing
                machine.target_setting = speeds[i]
            lift_m = max(spec.lift_m - spec.lift_slope * (level_m - spec.lift_reference_m), 0.0)
            for outlet in outlets:
                outlet.outfall_stage(lift_m + level_m)
            next(simulation)
            level_m = well.depth
            seen_m += (level_m - seen_m) * level_share
            damped += (np.array([machine.flow for machine in machines]) - damped) * flow_share


def _off_the_main(spec: Spec, level_m: Floats, pump_record: Floats) -> Floats:
    """(n,) largest difference of a running pump's head from what its main asks for its flow, over the shut-off head.

    0 but in steady running.
    """
    command, flow, head_m = pump_record[:3]
    is_steady = np.min([since_changes(one) for one in command], axis=0) >= STEADY_S
    lift_m = np.maximum(spec.lift_m - spec.lift_slope * (level_m - spec.lift_reference_m), 0.0)
    at_header_m = head_m - spec.own_loss * flow**2
    back = np.sum(command <= 0.0, axis=0) * spec.flap_leak * np.sqrt(np.maximum(at_header_m, 0.0))
    asked_m = lift_m + spec.shared_loss * (flow.sum(axis=0) - back) ** 2
    off = np.abs(at_header_m - asked_m) / spec.shutoff_m[:, None]
    return np.asarray(np.max(off, axis=0, where=is_steady & (command > 0.0), initial=0.0), dtype=np.float64)


def _followed(lag_s: float) -> float:
    """Share of a step that a first-order lag follows in one routing step."""
    return 1.0 if lag_s <= 0.0 else 1.0 - math.exp(-ROUTING_STEP_S / lag_s)
