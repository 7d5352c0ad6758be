"""Whether the act that a diagnosis proposes tells apart what it left open, on plants that are not the simulator.

    python benchmarks/experiments.py --seed 992001 --cases 24

Case k of seed S is that of the trial (`sim2real/trial/cases.py`), single effects, of the plants fine and elastic in
turn, of so many hours of a row a second. Those of effects that are easily told are passed over, and half of the cases
have no meter of head. Each is diagnosed. Where effects are declared equivalent, the first act that is proposed is
played on the same plant, under another seed of its noise and weather, and both recordings are diagnosed as one. The
control is the advice of before, one of ten fixed sentences, made an act that does as it says; both have the same
plant, seed and length. An answer is resolved where it declares nothing equivalent, and right where the set is the
truth. The diagnosis gets station file and recordings without truth. Water's inertia is set aside where the plant
always has it.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wetwell.protocols.orders import Step
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.diagnosis.diagnosis import Diagnosis, diagnose
from wetwell.sim2real.experiments.act import Site, site_of
from wetwell.sim2real.experiments.acts import acts_of
from wetwell.sim2real.trial.cases import StoragePlan, TrialCase, trial_case
from wetwell.sim2real.truth.case import TruthCase
from wetwell.sim2real.truth.elastic.plant import run_elastic
from wetwell.sim2real.truth.truth_plant import run

PLANTS = ("fine", "elastic")
CLOSE = {
    "friction_bias",
    "static_head_bias",
    "level_dependent_static_head",
    "air_pocket",
    "pump_wear",
    "motor_slip",
    "ragging",
    "unmetered_inflow",
    "check_valve_leak",
    "flow_meter_gain",
    "head_sensor_offset",
    "sump_area_profile",
}
"""Effects that are hard to tell from another one: cases of others are passed over."""
PAUSE_S = 3600
"""Between the first recording and the act. [s]"""
AFTERWARDS_S = 1200
"""Recorded beyond the expected end of the act. [s]"""
FIXED = {
    ("friction_bias", "static_head_bias"): "two",
    ("pump_wear", "motor_slip"): "speeds",
    ("pump_wear", "ragging"): "long",
    ("motor_slip", "ragging"): "long",
    ("unmetered_inflow", "check_valve_leak"): "shut",
    ("static_head_bias", "level_dependent_static_head"): "deep",
    ("flow_meter_lag", "channel_delay"): "trip",
    ("flow_meter_lag", "water_inertia"): "trip",
    ("static_head_bias", "air_pocket"): "stand",
    ("control_delay", "threshold_shift"): "wait",
}
"""The sentences of before, each by what it asks for."""


def played(truth: TruthCase, plant: str, steps: Sequence[Step], seconds: int) -> Recording:
    """What the same plant shows during an act."""
    case = replace(
        truth,
        steps=tuple(steps),
        seconds=seconds,
        seed=truth.seed + 1,
        start_ns=truth.start_ns + (truth.seconds + PAUSE_S) * NS_PER_S,
    )
    return recorded(case, plant)


def recorded(case: TruthCase, plant: str) -> Recording:
    """Recording of a case, without truth."""
    return (run if plant == "fine" else run_elastic)(case, truth=False)


def fixed_steps(found: Diagnosis, site: Site) -> tuple[str, tuple[Step, ...]]:
    """What the fixed sentence of a diagnosis asks for."""
    names = {effect.name for effect in found.effects}
    others = {name for effect in found.effects for name in effect.equivalent}
    asked = next((what for pair, what in FIXED.items() if set(pair) & names and set(pair) & others), "vary")
    acts = {act.name: act.steps for act in acts_of(site)}
    first = site.ready[0] + 1
    slow = acts.get(f"pump_{first}_at_90", ())
    two = next((steps for name, steps in acts.items() if name.startswith("pumps_")), slow)
    long = Step(longest_s=3600.0, speed_ratio=site.speeds(1.0, first - 1), low_m=site.stop_m)
    wanted: dict[str, tuple[Step, ...]] = {
        "two": two,
        "speeds": slow,
        "long": (site.fill(site.brim_m), long),
        "shut": (),  # the isolation valve of one pump is none that these plants have
        "deep": acts[f"pump_{first}_low"],
        "trip": (site.fill(site.brim_m), replace(long, longest_s=120.0)),
        "stand": acts["idle_hour"],
        "wait": (),
        "vary": (*slow, *acts[f"pump_{first}_low"], *two),
    }
    return asked, wanted[asked]


def answer(found: Diagnosis, case: TrialCase) -> dict[str, object]:
    """What a diagnosis says, and whether that is so."""
    inherent = set(case.family.inherent)
    names = {effect.name for effect in found.effects}
    others = sorted({name for effect in found.effects for name in effect.equivalent})
    return {
        "verdict": found.verdict,
        "effects": sorted(names),
        "equivalent": others,
        "sets": [[list(one.names), round(one.probability, 3)] for one in found.attribution.possible],
        "resolved": found.verdict == "effect" and not others,
        "right": names - inherent == set(case.names) - inherent,
    }


def tried(case: TrialCase) -> dict[str, object]:
    """A case: before, with the first act proposed, and with the fixed sentence."""
    truth = case.truth()
    station = truth.station
    before = recorded(truth, case.plant)
    try:
        first = diagnose(before, station)
    except ValueError as error:
        return {"case": case.number, "refused": str(error)}
    told: dict[str, object] = {"case": case.number, "plant": case.plant, "truth": list(case.names)}
    told["before"] = answer(first, case)
    if not any(effect.equivalent for effect in first.effects):
        return told
    told["truth_left"] = any(
        set(one.names) - set(case.family.inherent) == set(case.names) - set(case.family.inherent)
        for one in first.attribution.possible
    )
    proposals = first.proposals().best
    if not proposals:
        return told | {"proposed": None}
    best = proposals[0]
    site = site_of(station, set())
    seconds = round(2.0 * best.length_h * 3600.0) + AFTERWARDS_S
    seconds = max(seconds, 1801 + case.every_s)
    asked, steps = fixed_steps(first, site)
    for name, orders, act in (("proposed", best.act.steps, best.act.name), ("fixed", steps, asked)):
        during = played(truth, case.plant, orders, seconds)
        try:
            again = answer(diagnose([before, during], station), case)
        except ValueError as error:
            again = {"refused": str(error), "resolved": False, "right": False}
        told[name] = {"act": act, "bits": round(best.information_bits, 3)} | again
    return told


def summary(cases: Sequence[dict[str, object]]) -> dict[str, object]:
    """Shares over all cases in which something was declared equivalent."""
    open_ = [case for case in cases if "truth_left" in case]
    found: dict[str, object] = {"cases": len(cases), "declared_equivalent": len(open_)}
    found["truth_among_them"] = sum(bool(case["truth_left"]) for case in open_)
    for name in ("proposed", "fixed"):
        answers = [case[name] for case in open_ if isinstance(case.get(name), dict)]
        for key in ("resolved", "right"):
            found[f"{name}_{key}"] = sum(bool(one[key]) for one in answers)  # type: ignore[index]
        found[f"{name}_resolved_and_right"] = sum(bool(one["resolved"] and one["right"]) for one in answers)  # type: ignore[index]
    return found


def main() -> None:
    """Print one JSON object."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--seed", type=int, default=992001)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--cases", type=int, default=24)
    parser.add_argument("--hours", type=float, default=4.0)
    options = parser.parse_args()
    told = []
    for number in range(options.first, options.first + options.cases):
        storage = StoragePlan(absent=("head_m",) if number // 2 % 2 else ())
        seconds = round(3600 * options.hours)
        case = trial_case(options.seed, number, kinds=("single",), plants=PLANTS, seconds=seconds, storage=storage)
        if not set(case.names) & CLOSE:
            continue
        told.append(tried(case))
        print(json.dumps(told[-1]), file=sys.stderr, flush=True)
    print(json.dumps({"seed": options.seed, "hours": options.hours, **summary(told), "each": told}, indent=1))


if __name__ == "__main__":
    np.seterr(all="ignore")
    main()
