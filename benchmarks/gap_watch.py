"""What the watch of the gap names, and when: one JSON object on standard output.

    python benchmarks/gap_watch.py --change friction --cases 40
    python benchmarks/gap_watch.py --change none --cases 50 --days 10

Each case is a station of another plant than the one that diagnoses (`sim2real/truth/`), with its own equations,
weather and noise. In every second case one effect of the library acts from the beginning. With `--change friction`
the losses of the main grow by a tenth within a second, at a time that is drawn in the second day; with `none` nothing
changes. The watch gets station file and recording, day by day, as from the history. Truth is compared at the end.
"""

import argparse
import importlib.metadata
import json
import os
import platform
import sys
import time
from dataclasses import replace

import numpy as np

from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_DAY, NS_PER_S
from wetwell.sim2real.recording.preparation import Preparation, prepare
from wetwell.sim2real.truth.case import TruthCase, TruthFault
from wetwell.sim2real.truth.deviations import LIBRARY
from wetwell.sim2real.truth.sampling import case_of
from wetwell.sim2real.truth.truth_plant import run
from wetwell.sim2real.watch.spans import looked_over, refused, span_due
from wetwell.sim2real.watch.state import Called, WatchState
from wetwell.sim2real.watch.watching import watched
from wetwell.simulator.parameters import plant_parameters

RISE = 0.1
"""Of the losses of the main. [1]"""
NAMED_DAYS = 2.0
"""In which the change is to be named. [d]"""


def truth_of(seed: int, number: int, days: float, change: str) -> tuple[TruthCase, float | None]:
    """A case of the seed, and when its main changes. [s]."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number,)))
    names = (LIBRARY[int(rng.integers(len(LIBRARY)))],) if number % 2 else ()
    truth = case_of(names, f"station-{number}", rng, seconds=round(days * 86_400), slow_share=0.2 * (number % 4 > 1))
    if change == "none":
        return truth, None
    at_s = float(rng.uniform(86_400.0, 2.0 * 86_400.0))
    fault = TruthFault(kind="clogging", start_s=at_s, end_s=at_s + 1.0, size=RISE)
    return replace(truth, faults=(fault,)), at_s


def day_of(recording: Recording, begins_ns: int, ends_ns: int) -> Recording:
    """Rows of a span, without truth."""
    rows = slice(*np.searchsorted(recording.time_ns, [begins_ns, ends_ns]))
    columns = {name: values[rows] for name, values in recording.columns.items()}
    return replace(recording, time_ns=recording.time_ns[rows], columns=columns, truth={})


def told(one: Called, start_ns: int) -> dict[str, object]:
    """What the watch said, in days since the first row."""
    return {
        "name": one.name or f"unknown at {one.component}",
        "equivalent": [] if one.effect is None else sorted(one.effect.equivalent),
        "probability": one.probability,
        "since_days": None if one.since_ns is None else round((one.since_ns - start_ns) / NS_PER_DAY, 3),
        "named_days": round((one.named_ns - start_ns) / NS_PER_DAY, 3),
    }


def watched_case(seed: int, number: int, days: float, change: str) -> dict[str, object]:
    """One station: what acts, when it changes, what was told, and what the looks took."""
    truth, at_s = truth_of(seed, number, days, change)
    recording = run(truth, truth=False)
    start_ns, state = int(recording.time_ns[0]), WatchState(station=truth.station)
    said: list[dict[str, object]] = []
    seconds: list[float] = []
    while (span := span_due(state, start_ns, int(recording.time_ns[-1]) + NS_PER_S)) is not None:
        part = day_of(recording, *span)
        began_s = time.process_time()
        try:
            state = looked_over(watched(state, prepare(part, Preparation())[0]), span[1])
        except ValueError as error:
            state = refused(state, *span, len(part), str(error))
        seconds.append(round(time.process_time() - began_s, 2))
        for one in state.called:
            row = told(one, start_ns)
            if row not in said:
                said.append(row)
    return {
        "case": number,
        "acts": [deviation.name for deviation in truth.deviations],
        "changes_at_days": None if at_s is None else round(at_s / 86_400.0, 3),
        "flow_share": flow_share(truth),
        "looks": len(state.looks),
        "refused": state.refused,
        "said": said,
        "seconds": seconds,
    }


def flow_share(truth: TruthCase) -> float:
    """By how much the rise of the losses changes the flow of the first pump alone, by the station file. [1]."""
    plant = plant_parameters(truth.station)
    main = plant.main_of(0)
    c0, c1, c2 = plant.curves[0]

    def flow_m3h(factor: float) -> float:
        static_m = main.static_head_m
        square = c2 - factor * main.friction_h2_m5
        return float(min(r for r in np.roots([square, c1, c0 - static_m]).real if r > 0.0))

    return round(flow_m3h(1.0 + RISE) / flow_m3h(1.0) - 1.0, 4)


def judged(case: dict[str, object]) -> str:
    """`right` (friction in time), `equivalent` (as one of its equals), `other`, `late`, or `missed`."""
    news = [row for row in case["said"] if row["since_days"] is not None]
    in_time = [row for row in news if row["named_days"] <= case["changes_at_days"] + NAMED_DAYS]
    if any(row["name"] == "friction_bias" for row in in_time):
        return "right"
    if any("friction_bias" in row["equivalent"] for row in in_time):
        return "equivalent"
    return "other" if in_time else "late" if news else "missed"


def main() -> None:
    """Watch all cases, one after the other; each is told on standard error."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--change", choices=("friction", "none"), default="friction")
    parser.add_argument("--seed", type=int, default=993001)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--days", type=float, default=4.0)
    given = parser.parse_args()
    cases = []
    for number in range(given.first, given.first + given.cases):
        try:
            cases.append(watched_case(given.seed, number, given.days, given.change))
        except ValueError as error:
            cases.append({"case": number, "error": str(error), "looks": 0, "said": [], "seconds": []})
        sys.stderr.write(json.dumps(cases[-1]) + "\n")
    looked = [case for case in cases if case["looks"]]
    spent = sorted(second for case in looked for second in case["seconds"][1:])
    result = {
        "version": importlib.metadata.version("wetwell"),
        "python": platform.python_version(),
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[0], 1),
        "seed": given.seed,
        "change": given.change,
        "cases": len(cases),
        "not_looked_at": len(cases) - len(looked),
        "station_days": sum(case["looks"] for case in looked),
        "names_after_the_first_look": sum(row["since_days"] is not None for case in looked for row in case["said"]),
        "processor_s_a_look": {
            "median": spent[len(spent) // 2] if spent else None,
            "mean": round(float(np.mean(spent)), 2) if spent else None,
            "most": spent[-1] if spent else None,
        },
    }
    if given.change == "friction":
        answers = [judged(case) for case in looked]
        result["answers"] = {name: answers.count(name) for name in sorted(set(answers))}
    json.dump(result | {"by_case": cases}, sys.stdout, indent=1)
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
