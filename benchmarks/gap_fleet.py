"""What a fleet tells a new station: one JSON object on standard output.

    python benchmarks/gap_fleet.py --stations 19 --new 3 --spread 0.02

Each station is of another plant than the one that diagnoses (`sim2real/truth/`), with its own size, weather and
noise. The mains of all are rougher than their files say: by a factor whose mean is 1.25, and whose standard deviation
among stations is `--spread`. How alike a real fleet is nobody has measured: the spread is an assumption, and the
result is for it alone. The stations are diagnosed by a day each. New ones are diagnosed by 6, 12 and 24 hours, with
their prior and without.
"""

import argparse
import importlib.metadata
import json
import os
import platform
import sys
from dataclasses import replace

import numpy as np

from wetwell.sim2real.diagnosis.diagnosis import Diagnosis, diagnose
from wetwell.sim2real.fleet.fleet_prior import Finding, fleet_prior
from wetwell.sim2real.likelihood.priors import EVEN, Priors
from wetwell.sim2real.truth.case import Deviation, TruthCase
from wetwell.sim2real.truth.sampling import case_of
from wetwell.sim2real.truth.truth_plant import run

MEAN = 1.25
HOURS = (6, 12, 24)


def truth_of(seed: int, number: int, spread: float) -> tuple[TruthCase, float]:
    """A station of the seed, and by what its main is rougher."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number,)))
    factor = float(rng.normal(MEAN, spread))
    truth = case_of((), f"station-{number}", rng, seconds=86_400)
    rough = Deviation(name="friction_bias", parameters={"factor": factor, "smoothness": 0.0})
    return replace(truth, deviations=(rough,)), factor


def diagnosed(truth: TruthCase, hours: float, priors: Priors = EVEN) -> Diagnosis:
    """Diagnosis of the first hours of a station."""
    return diagnose(run(replace(truth, seconds=round(hours * 3600)), truth=False), truth.station, priors=priors)


def factor_of(found: Diagnosis) -> tuple[float, float, float] | None:
    """Factor with its interval, where friction is what was found."""
    for effect in found.effects:
        if effect.name == "friction_bias":
            one = effect.parameters["factor"]
            return float(one.value), *one.ci
    return None


def new_station(truth: TruthCase, factor: float, priors: Priors) -> dict[str, object]:
    """Names, values and intervals by hours, with the prior of the fleet and without."""
    rows = []
    for hours in HOURS:
        for kind, known in (("even", EVEN), ("fleet", priors)):
            try:
                found = diagnosed(truth, hours, known)
            except ValueError as error:
                rows.append({"hours": hours, "prior": kind, "refused": str(error)})
                continue
            told = factor_of(found)
            rows.append({"hours": hours, "prior": kind, "names": [effect.name for effect in found.effects]})
            if told is not None:
                value, low, high = (round(one, 5) for one in told)
                rows[-1] |= {"value": value, "width": round(high - low, 5), "holds": low <= factor <= high}
    return {"station": truth.station.name, "factor": round(factor, 5), "rows": rows}


def main() -> None:
    """Diagnose the fleet, then the new stations; each is told on standard error."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=993003)
    parser.add_argument("--stations", type=int, default=19)
    parser.add_argument("--new", type=int, default=3)
    parser.add_argument("--spread", type=float, default=0.02)
    given = parser.parse_args()
    findings = []
    for number in range(given.stations):
        truth, factor = truth_of(given.seed, number, given.spread)
        found = diagnosed(truth, 24.0)
        findings.append(Finding(station=truth.station.name, effects=found.own_effects))
        names = [effect.name for effect in found.effects]
        sys.stderr.write(
            json.dumps({"station": number, "factor": factor, "names": names, "told": factor_of(found)}) + "\n"
        )
    prior = fleet_prior(findings)
    news = []
    for number in range(given.stations, given.stations + given.new):
        news.append(new_station(*truth_of(given.seed, number, given.spread), prior.priors))
        sys.stderr.write(json.dumps(news[-1]) + "\n")
    widths = {
        f"{kind} {hours} h": [
            row["width"]
            for one in news
            for row in one["rows"]
            if (row["prior"], row["hours"]) == (kind, hours) and "width" in row
        ]
        for kind in ("even", "fleet")
        for hours in HOURS
    }
    result = {
        "version": importlib.metadata.version("wetwell"),
        "python": platform.python_version(),
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[0], 1),
        "seed": given.seed,
        "stations": given.stations,
        "spread": given.spread,
        "prior": prior.parameters.get("friction_bias", {}).get("factor").model_dump(mode="json")
        if "factor" in prior.parameters.get("friction_bias", {})
        else None,
        "median_width": {name: round(float(np.median(some)), 5) if some else None for name, some in widths.items()},
        "new": news,
    }
    json.dump(result, sys.stdout, indent=1)
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
