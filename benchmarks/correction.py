"""Corrections learnt on open deviations and on truths without any: term, covariate, shrinkage on a fresh recording.

    python benchmarks/correction.py --seed 991001 --cases 24 --hours 24

Each case is drawn as in `wetwell gap trial` (kinds as said; plants fine and elastic take turns). The correction is
learnt whether or not a diagnosis would say `unknown`. Where one is taken on a truth without any, the diagnosis is
made, too: only its `unknown` would let a user see it. Of what was left out of the library the component is known, and
no covariate. A late channel has another component than the term that it is in the simulator: it is read wrong. That
term is right for it, too.
"""

import argparse
import json
import time
from dataclasses import replace
from typing import Any

import numpy as np

from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.services.trial.plan import parse_kinds
from wetwell.services.trial.plants import passage_of
from wetwell.sim2real.correction.learning import learn
from wetwell.sim2real.diagnosis.correction import weighed
from wetwell.sim2real.diagnosis.diagnosis import diagnose
from wetwell.sim2real.recording.preparation import Preparation, prepare
from wetwell.sim2real.recording.regimes import regimes_of
from wetwell.sim2real.recording.traces import Traces, traces_of
from wetwell.sim2real.replay.replay import Prediction, Replay
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.sim2real.trial.cases import CaseKind, StoragePlan, trial_case
from wetwell.sim2real.trial.holdout import gap, shrinkage, whitened
from wetwell.sim2real.truth.case import TruthCase
from wetwell.simulator.effects import effects_of

RIGHT: dict[str, tuple[set[str], set[str]]] = {
    "flow_meter_drift": ({"flow_reading"}, {"days", "hour_of_day"}),
    "friction_daily_cycle": ({"head_loss"}, {"hour_of_day", "days"}),
    "breaking_siphon": ({"static_head"}, {"since_start_s", "flow_m3h"}),
    "head_sensor_scale": ({"head_reading"}, {"hour_of_day", "days", "flow_m3h"}),
    "second_sump": ({"level_balance"}, {"hour_of_day", "days"}),
    "clock_drift": (set(), {"days"}),
    "power_meter_drift": ({"power"}, {"days"}),
    "foam": ({"level_reading"}, set()),
    "inlet_vortex": ({"pump_head"}, {"level_m"}),
    "speed_hunting": ({"speed"}, set()),
    "outlet_tide": ({"static_head"}, {"days", "hour_of_day"}),
    "shared_main": ({"static_head"}, set()),
    "pipe_scouring": ({"head_loss"}, {"days"}),
    "electrode_fouling": ({"flow_reading"}, {"days", "hour_of_day"}),
    "cavitation": ({"pump_head"}, {"level_m", "flow_m3h"}),
    "warming_power_meter": ({"power"}, {"hour_of_day", "days"}),
    "wandering_head_zero": ({"head_reading"}, set()),
    "second_echo": ({"level_reading"}, set()),
    "storm_tank": ({"level_balance"}, {"hour_of_day", "days"}),
    "skipping_clock": (set(), {"days"}),
    "beating_drive": ({"speed"}, set()),
}
"""Terms and covariates that describe a deviation; no covariate where it comes at random or faster than a bin."""
READING_OF = {
    "flow_m3h": "flow_reading",
    "head_m": "head_reading",
    "power_kw": "power",
    "level_m": "level_reading",
    "frequency_hz": "speed",
}


def right_of(truth: TruthCase) -> tuple[set[str], set[str]]:
    """Terms and covariates that describe the first deviation of a truth; none where only its component does."""
    first = truth.deviations[0]
    match first.name:
        case "channel_delay":
            return {READING_OF[str(first.parameters["channel"])]}, set()
        case name:
            return RIGHT.get(name, (set(), set()))


def replayed(recording: Recording, station: Station) -> Recording:
    """What the simulator says for a recording of each second."""
    traces = traces_of(recording, station)
    prediction = Replay(traces, station, effects_of(station)).run()
    return replace(recording, columns=_columns(traces, prediction), truth={})


def _columns(traces: Traces, prediction: Prediction) -> dict[str, Any]:
    columns = {"level_m": prediction.level_m}
    for name, values in prediction.signals.items():
        columns |= {f"pump{i}_{name}": one for i, one in enumerate(values, start=1)}
    return {name: values[traces.is_row] for name, values in columns.items()}


def measured(seed: int, number: int, hours: float, kinds: tuple[CaseKind, ...]) -> dict[str, Any]:
    """Figures of one case."""
    case = trial_case(
        seed,
        number,
        kinds=kinds,
        plants=("fine", "elastic"),
        seconds=round(3600.0 * hours),
        storage=StoragePlan(metered_share=0.7),
    )
    truth = case.truth()
    station = truth.station
    recording, _ = prepare(passage_of(truth, case.plant).recording(truth=False), Preparation())
    traces = traces_of(recording, station)
    replay = Replay(traces, station)
    regimes = regimes_of(traces, station)
    residuals = StationResiduals(traces, station, regimes, replay.run(), replay.doubt)
    begin = time.perf_counter()
    taken, why = weighed(learn(replay, residuals), residuals.bins, replay.run().plant, np.random.default_rng(0))
    row: dict[str, Any] = {"case": number, "kind": case.kind, "plant": case.plant, "names": list(case.names)}
    row |= {"seconds": round(time.perf_counter() - begin, 1), "is_taken": taken is not None, "why": why}
    if taken is None:
        return row
    if case.kind == "none":
        row["verdict"] = diagnose(recording, station).verdict
    passage = passage_of(replace(truth, seed=truth.seed + 1), case.plant)
    fresh, oracle = passage.recording(truth=False), passage.oracle()
    after = station.model_copy(update={"effect": (taken.table,)})
    gaps = [
        gap(whitened(said, fresh, station.sensors))
        for said in (replayed(fresh, station), replayed(fresh, after), oracle)
    ]
    terms, covariates = right_of(truth) if case.names else (set(), set())
    told = [(one.term, one.component) for one in (taken.report, *taken.report.equivalent)]
    is_right = [(term in terms, component in case.components) for term, component in told]
    return row | {
        "equation": taken.report.equation,
        "is_term_right": is_right[0][0],
        "is_component_right": is_right[0][1],
        "is_term_or_component_right": any(is_right[0]),
        "is_it_or_an_equivalent_right": any(map(any, is_right)),
        "components": sorted({component for _, component in told}),
        "is_covariate_right": bool(covariates & set(taken.report.covariates)) if case.kind == "open" else None,
        "shrinkage_held_out": taken.report.shrinkage,
        "shrinkage_fresh": shrinkage(*gaps),
        "gaps_fresh": [round(one, 3) for one in gaps],
    }


def main() -> None:
    """Print one line a case, then the summary."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=991_001)
    parser.add_argument("--cases", type=int, default=24)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--kinds", type=parse_kinds, default=("open", "none"), help="of the trial; with commas")
    given = parser.parse_args()
    rows = []
    for number in range(given.cases):
        rows.append(measured(given.seed, number, given.hours, given.kinds))
        print(json.dumps(rows[-1]), flush=True)
    gaps = [row for row in rows if row["kind"] != "none"]
    taken = [row for row in gaps if row["is_taken"]]
    of_known = [row["is_covariate_right"] for row in taken if row["is_covariate_right"] is not None]
    nothing = [row for row in rows if row["kind"] == "none"]
    fresh = [row["shrinkage_fresh"] for row in taken if row["shrinkage_fresh"] is not None]
    summary = {
        "with_a_gap": len(gaps),
        "taken": len(taken),
        "component_right": sum(row["is_component_right"] for row in taken),
        "term_or_component_right": sum(row["is_term_or_component_right"] for row in taken),
        "it_or_an_equivalent_right": sum(row["is_it_or_an_equivalent_right"] for row in taken),
        "of_several_components": sum(len(row["components"]) > 1 for row in taken),
        "covariate_known": len(of_known),
        "covariate_right": sum(of_known),
        "shrinkage_fresh_median": float(np.median(fresh)) if fresh else None,
        "shrinkage_fresh_least": min(fresh, default=None),
        "none": len(nothing),
        "taken_on_none": sum(row["is_taken"] for row in nothing),
        "taken_on_none_and_unknown": sum(row.get("verdict") == "unknown" for row in nothing),
        "seconds_median": float(np.median([row["seconds"] for row in rows])),
    }
    print(json.dumps(summary))


if __name__ == "__main__":
    main()
