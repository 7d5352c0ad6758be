"""Stages, dates and alarms of slow faults on simulated stations: one JSON object on standard output.

    python benchmarks/severity.py healthy --stations 10 --first-seed 87001
    python benchmarks/severity.py slow --stations 20 --first-seed 87101
    python benchmarks/severity.py months --stations 100 --first-seed 87201

`healthy`: stations over 30 days whose friction drifts by up to 3 % up or down, whose pumps wear by 1 % of the head in
a month and whose flow meters drift by up to 1 %; no stage but `watch` may be told. `slow`: a main that clogs by 25 to
45 %, or a pump that loses 8 % of its head, in 10 to 30 days: how far from the limit `act` is told, and how right the
date is that is told at half of it. `months`: stations over 30 days with one to three causes, each of which must raise
one alarm.

The stations are polled every `--period` seconds. Seeds below 100 are for looking.
"""

import argparse
import importlib.metadata
import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from wetwell.detector.detector import Detector
from wetwell.detector.evaluation.scores import without_truth
from wetwell.detector.stream.block import blocks
from wetwell.protocols.messages.verdict import AssetFault, Verdict
from wetwell.protocols.station.limits import Limits
from wetwell.protocols.timestamps import NS_PER_DAY, NS_PER_S
from wetwell.services.alarms.registry import AlarmRegistry
from wetwell.services.alarms.station_clock import Now
from wetwell.services.alarms.station_watch import StationWatch
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.faults import Fault
from wetwell.simulator.faults.pump.blockage import Blockage
from wetwell.simulator.faults.pump.impeller_wear import ImpellerWear
from wetwell.simulator.faults.rising_main.pipe_clogging import PipeClogging
from wetwell.simulator.faults.telemetry.sensor_drift import SensorDrift
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

DAY_S = 86_400.0
MONTH_DAYS = 30.0
DUTY_FLOW_M3H = 200.0
"""Of the station `alpha`, of which the drift of a flow meter is a share."""
PERIOD_S = 10


def scenario_with(*faults: Fault, days: float = MONTH_DAYS) -> Scenario:
    return find_scenario("nominal").model_copy(update={"fault": faults, "duration_s": days * DAY_S})


def verdicts_on(scenario: Scenario, seed: int, period_s: int) -> Iterator[tuple[float, Verdict]]:
    """Verdicts with their time since the start of the scenario. [d]."""
    station = find_station("alpha")
    simulation, detector = Simulation(station, scenario, seed), Detector.of(station)
    begin_ns: int | None = None
    for _ in range(round(scenario.duration_s / DAY_S)):
        day = without_truth(simulation.advance(int(DAY_S)))
        begin_ns = int(day.time_ns[0]) if begin_ns is None else begin_ns
        polled = replace(
            day,
            time_ns=day.time_ns[::period_s],
            columns={name: values[::period_s] for name, values in day.columns.items()},
        )
        for block in blocks(polled, len(station.pump)):
            for verdict in detector.update_block(block):
                yield (verdict.time - begin_ns) / NS_PER_DAY, verdict


def fault_of(verdict: Verdict, asset: str) -> AssetFault | None:
    return next((fault for fault in verdict.faults or () if fault.asset == asset), None)


def healthy(seed: int, period_s: int) -> dict[str, Any]:
    """Worst stage, and what was told of it, of a station that only drifts."""
    rng = np.random.default_rng(seed)
    end_s, hours = MONTH_DAYS * DAY_S, MONTH_DAYS * 24.0
    drift = float(rng.uniform(-0.01, 0.01)) * DUTY_FLOW_M3H / hours
    faults = [
        PipeClogging(friction_rise=float(rng.uniform(-0.03, 0.03)), start_s=0.0, end_s=end_s),
        SensorDrift(channel="flow_m3h", bias_per_hour=drift, start_s=0.0, end_s=end_s),
        *(ImpellerWear(pump=pump, head_loss=0.01, start_s=0.0, end_s=end_s) for pump in (1, 2, 3)),
    ]
    told: dict[str, float] = {}
    for at_days, verdict in verdicts_on(scenario_with(*faults), seed, period_s):
        for fault in verdict.faults or ():
            told.setdefault(f"{fault.asset} {fault.stage}", round(at_days, 2))
    return {"days": MONTH_DAYS, "first_told_days": told}


def slow(seed: int, period_s: int) -> dict[str, Any]:
    """Truth when `act` was told, and the date that was told when half of the limit was passed."""
    rng, limits = np.random.default_rng(seed), Limits()
    days, start_days = float(rng.uniform(10.0, 30.0)), 2.0
    is_main = seed % 2 == 0
    span = {"start_s": start_days * DAY_S, "end_s": (start_days + days) * DAY_S}
    if is_main:
        asset, limit, full = "main", limits.friction_rise_percent, float(rng.uniform(25.0, 45.0))
        fault: Fault = PipeClogging(friction_rise=full / 100.0, **span)
    else:
        asset, limit, full = "pump:1", limits.wear_head_percent, 8.0
        fault = ImpellerWear(pump=1, head_loss=full / 100.0, **span)
    reached_days = start_days + days * limit / full
    half_days = start_days + days * 0.5 * limit / full
    found: dict[str, Any] = {"asset": asset, "days": round(days, 2), "full": round(full, 2), "limit": limit}
    for at_days, verdict in verdicts_on(scenario_with(fault, days=start_days + days), seed, period_s):
        told = fault_of(verdict, asset)
        if told is None:
            continue
        trend = told.trend
        if "date" not in found and at_days >= half_days and trend is not None and trend.reaches_limit is not None:
            left_days = (trend.reaches_limit - verdict.time) / NS_PER_DAY
            found["date"] = {"told_days": round(left_days, 3), "true_days": round(reached_days - at_days, 3)}
            found["date"]["is_within"] = _is_within(verdict, told, reached_days - at_days)
        if told.stage == "act":
            found["act_at"] = round(full * (at_days - start_days) / days, 3)
            break
    return found


def _is_within(verdict: Verdict, fault: AssetFault, true_days: float) -> bool:
    """Whether the true date lies in the interval that is told."""
    if fault.trend is None:
        return False
    earliest, latest = fault.trend.interval_at
    at_ns = verdict.time + true_days * NS_PER_DAY
    return (earliest is None or earliest <= at_ns) and (latest is None or at_ns <= latest)


def months(seed: int, period_s: int) -> dict[str, Any]:
    """How often each cause has raised an alarm that calls."""
    rng = np.random.default_rng(seed)
    kinds = rng.permutation(["clog", "rags", "wear"])[: int(rng.integers(1, 4))]
    faults: list[Fault] = []
    for place, kind in enumerate(kinds):
        start_s = (1.5 + 9.0 * place + float(rng.uniform(0.0, 2.0))) * DAY_S
        slow_s, fast_s = float(rng.uniform(3.0, 8.0)) * DAY_S, float(rng.uniform(0.05, 0.5)) * DAY_S
        fault: Fault
        if kind == "clog":
            rise = float(rng.uniform(0.25, 0.6))
            fault = PipeClogging(friction_rise=rise, start_s=start_s, end_s=start_s + slow_s, after="clear")
        elif kind == "rags":
            loss = float(rng.uniform(0.05, 0.2))
            fault = Blockage(pump=2, speed_loss=loss, start_s=start_s, end_s=start_s + fast_s, after="clear")
        else:
            fault = ImpellerWear(pump=1, head_loss=0.08, start_s=start_s, end_s=start_s + slow_s, after="clear")
        faults.append(fault)
    registry, watch = AlarmRegistry(), StationWatch("alpha", missed_s=0.0, start_s=-1e9)
    raised: dict[str, int] = {}
    is_up: dict[str, bool] = {}
    for _, verdict in verdicts_on(scenario_with(*faults), seed, period_s):
        watch.handle_verdict(verdict, Now(verdict.time, verdict.time / NS_PER_S), registry)
        for alarm in registry.changed:
            is_call = alarm.is_active and alarm.priority != "advisory"
            raised[alarm.id] = raised.get(alarm.id, 0) + (is_call and not is_up.get(alarm.id, False))
            is_up[alarm.id] = alarm.is_active and (is_call or is_up.get(alarm.id, False))
        registry.changed.clear()
    expected = {"clog": "main.system_fault", "rags": "pump2.pump_fault", "wear": "pump1.pump_fault"}
    wanted = {expected[kind]: 1 for kind in kinds}
    calls = {name: count for name, count in raised.items() if count}
    return {"causes": [str(kind) for kind in kinds], "calls": calls, "is_one_each": calls == wanted}


def summary(bar: str, found: list[dict[str, Any]]) -> dict[str, Any]:
    """What the bars ask for."""
    if bar == "healthy":
        stages = [name for one in found for name in one["first_told_days"]]
        return {
            "station_days": sum(one["days"] for one in found),
            "plan_or_act": sum(not name.endswith("watch") for name in stages),
        }
    if bar == "months":
        return {"months": len(found), "one_alarm_each": sum(one["is_one_each"] for one in found)}
    errors = [one["act_at"] - one["limit"] for one in found if "act_at" in one]
    dates = [one["date"] for one in found if "date" in one]
    near = [abs(date["told_days"] / date["true_days"] - 1.0) <= 0.25 for date in dates]
    return {
        "faults": len(found),
        "act_told": len(errors),
        "act_error_points": [round(float(value), 3) for value in np.quantile(errors, [0.0, 0.5, 1.0])],
        "dates": len(dates),
        "date_within_25_percent": round(float(np.mean(near)), 3),
        "date_in_its_interval": round(float(np.mean([date["is_within"] for date in dates])), 3),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bar", choices=["healthy", "slow", "months"])
    parser.add_argument("--stations", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=87001)
    parser.add_argument("--period", type=int, default=PERIOD_S, help="seconds from poll to poll")
    arguments = parser.parse_args()
    look = {"healthy": healthy, "slow": slow, "months": months}[arguments.bar]
    found = []
    for seed in range(arguments.first_seed, arguments.first_seed + arguments.stations):
        found.append(look(seed, arguments.period))
        print(seed, json.dumps(found[-1]), file=sys.stderr, flush=True)
    about = {
        "benchmark": "severity",
        "version": importlib.metadata.version("wetwell"),
        "bar": arguments.bar,
        "seeds": [arguments.first_seed, arguments.first_seed + arguments.stations - 1],
        "period_s": arguments.period,
    }
    print(json.dumps(about | summary(arguments.bar, found) | {"each": found}, indent=2))


if __name__ == "__main__":
    main()
