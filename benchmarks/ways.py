"""Ways of the data: how many calls go from room to room, and how many come back to a room that was entered before.

    python benchmarks/ways.py

A room is a folder of a package, or a file that lies beside them. A call is a function that is entered from another
room, counted once however often it is made; the first into a room opens it, every other one is a return. The same is
counted from file to file. The ways: a steady sample, a sample that ends a run of a learnt pump, a diagnosis. The
compiled functions of the detector run as plain Python, so that they count too; those of the plant do not: records
have named fields only where they are compiled.
"""

import json
import sys
import warnings
from collections.abc import Callable
from types import FrameType

from numba import config

import wetwell
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.stations import find_station
from wetwell.sim2real.replay.replay import Replay  # noqa: F401 - compiled, as the plant is
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

config.DISABLE_JIT = True  # for what is imported from here on

from wetwell.detector.detector import Detector  # noqa: E402
from wetwell.sim2real.diagnosis.diagnosis import diagnose  # noqa: E402

SEED = 3
LEARNT_S, LENGTH_S, DIAGNOSED_S = 22_500, 24_000, 14_400
EFFECTS = ("friction_bias", "pump_wear")


def way(package: str, act: Callable[[], object]) -> dict[str, int]:
    """Calls, rooms and returns of what is done within a package, and the same between files."""
    home = f"{next(iter(wetwell.__path__))}/{package}/"
    calls: set[tuple[str, str, str]] = set()

    def note(frame: FrameType, event: str, _: object) -> None:
        here = frame.f_code.co_filename
        if event != "call" or not here.startswith(home) or frame.f_code.co_name.startswith("<"):
            return
        caller = frame.f_back
        while caller is not None and not caller.f_code.co_filename.startswith(home):
            caller = caller.f_back
        there = "" if caller is None else caller.f_code.co_filename.removeprefix(home)
        calls.add((there, here.removeprefix(home), frame.f_code.co_qualname))

    sys.setprofile(note)
    try:
        act()
    finally:
        sys.setprofile(None)
    result = {}
    for prefix, place in (("", room), ("file_", str)):
        taken = {(place(there), place(here), name) for there, here, name in calls if place(there) != place(here)}
        rooms = len({here for _, here, _ in taken})
        result |= {f"{prefix}calls": len(taken), f"{prefix}rooms": rooms, f"{prefix}returns": len(taken) - rooms}
    return result


def room(file: str) -> str:
    """Folder of a file within its package, or the file itself where it lies beside the folders."""
    return file.partition("/")[0]


def ways_of_samples(detector: Detector, simulation: Simulation) -> dict[str, dict[str, int]]:
    """The longest way of a sample that brings no verdict, before the first that ends a run of a learnt pump."""
    samples = list(simulation.advance(LENGTH_S).samples(simulation.station.name))
    for sample in samples[:LEARNT_S]:
        detector.update(sample)
    longest = {"calls": 0}
    for sample in samples[LEARNT_S:]:
        told: list[Verdict] = []
        taken = way("detector", lambda sample=sample, told=told: told.extend(detector.update(sample)))  # type: ignore[misc]
        if told:
            return {"sample": longest, "run": taken}
        longest = max(longest, taken, key=lambda each: each["calls"])
    raise SystemExit("no run has ended")


def main() -> None:
    warnings.simplefilter("ignore", RuntimeWarning)  # of plain Python where compiled code divides by zero in silence
    station = find_station("alpha")
    detector = Detector.of(station)
    main_of = station.rising_main
    rough = main_of.model_copy(update={"friction_h2_m5": 1.2 * main_of.friction_h2_m5})
    recording = Simulation(station, Scenario(name="healthy"), SEED).advance(DIAGNOSED_S, truth=False)
    believed = station.model_copy(update={"rising_main": rough})
    plant = Simulation(station, Scenario(name="healthy"), SEED)
    result = {
        **ways_of_samples(detector, plant),
        "diagnosis": way("sim2real", lambda: diagnose(recording, believed, only=EFFECTS)),
    }
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
