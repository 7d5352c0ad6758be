"""What is loaded before the first sample is all that is ever compiled: no judging waits for a compiler."""

import sys

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.stream.block import blocks
from wetwell.protocols.jit import Kernel
from wetwell.services.detector.kernels import load_kernels
from wetwell.services.stations import find_scenario, find_station
from wetwell.simulator.simulation import Simulation

DEMO_S = 64_800


def compiled() -> dict[str, int]:
    """Number of compiled forms of each function of the detector that is called from Python."""
    return {
        f"{name}.{each}": len(value.dispatcher.signatures)
        for name, module in list(sys.modules.items())
        if name.startswith("wetwell.detector")
        for each, value in vars(module).items()
        if isinstance(value, Kernel)
    }


def test_a_day_with_faults_compiles_nothing_that_was_not_loaded() -> None:
    load_kernels()
    before = compiled()
    for name in ("alpha", "twin"):
        station = find_station(name)
        recording = Simulation(station, find_scenario("demo"), 1).advance(DEMO_S, truth=False)
        detector = Detector(station.name, datasheet_of(station))
        for sample in recording.samples(station.name):
            detector.update(sample)
            break
        states = {
            verdict.state
            for block in blocks(recording, len(station.pump))
            for verdict in detector.update_block(block)
        }
        assert {"normal", "pump_fault", "system_fault"} <= states
    assert compiled() == before
    assert sum(before.values()) > 5, "kernels that are called from Python"
