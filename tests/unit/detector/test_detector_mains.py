"""Several rising mains in the whole detector: what befalls one is not told of the pumps of the other."""

import numpy as np
import pytest
from judging import verdicts_on

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.snapshot.codec import SnapshotError
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.stations import find_station
from wetwell.simulator.faults.pump.blockage import Blockage
from wetwell.simulator.inflow.diurnal import DiurnalInflow
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

HALF_DAY_S = 12 * 3600
SEED = 11


@pytest.fixture(scope="module")
def twin():
    """Pumps 1 and 3 on the first main, 2 and 4 on the second; both lift to a delivery level."""
    return find_station("twin")


def recorded(station, seed, start_ns, *faults):
    scenario = Scenario(name="day", initial_level_m=0.0, inflow=DiurnalInflow(), fault=faults)
    return Simulation(station, scenario, seed, start_ns).advance(HALF_DAY_S, truth=False)


def told(detector, recording):
    """Verdicts of each pump."""
    verdicts = verdicts_on(detector, recording)
    return {pump: [verdict for verdict in verdicts if verdict.pump == pump] for pump in range(1, 5)}


@pytest.fixture(scope="module")
def learnt(twin):
    """Snapshot of a detector after half a healthy day, and when that ended."""
    detector = Detector(twin.name, datasheet_of(twin))
    recording = recorded(twin, SEED, 0)
    first = told(detector, recording)
    assert {verdict.state for each in first.values() for verdict in each} == {"learning", "normal"}
    assert all(baseline is not None for baseline in detector.baselines)
    return detector.snapshot(), int(recording.time_ns[-1]) + NS_PER_S


def restored(station, snapshot):
    detector = Detector(station.name, datasheet_of(station))
    detector.restore(snapshot)
    return detector


@pytest.mark.parametrize(("clogged", "pumps"), [(0, {1, 3}), (1, {2, 4})])
def test_a_main_that_clogs_is_a_system_fault_of_its_own_pumps_only(twin, learnt, clogged, pumps):
    mains = list(twin.mains)
    rough = 2.0 * mains[clogged].friction_h2_m5
    mains[clogged] = mains[clogged].model_copy(update={"friction_h2_m5": rough})
    detector = restored(twin, learnt[0])
    after = told(detector, recorded(twin.with_mains(mains), SEED + 1, learnt[1]))
    for pump, verdicts in after.items():
        assert len(verdicts) > 4
        expected = "system_fault" if pump in pumps else "normal"
        assert {verdict.state for verdict in verdicts[1:]} == {expected}
        assert {verdict.evidence["main"] for verdict in verdicts} == {twin.mains[twin.main_of_pump[pump - 1]].name}


def test_a_blocked_pump_is_told_and_neither_main(twin, learnt):
    fault = Blockage(pump=2, speed_loss=0.2, shape="step", start_s=0, end_s=1)
    after = told(restored(twin, learnt[0]), recorded(twin, SEED + 2, learnt[1], fault))
    assert {verdict.state for verdict in after[2][1:]} == {"pump_fault"}
    assert {verdict.state for pump in (1, 3, 4) for verdict in after[pump]} == {"normal"}


def test_the_belief_about_each_main_is_kept_and_only_that_of_a_relearnt_pump_forgotten(twin, learnt):
    """A snapshot goes on bit for bit; after a new baseline of pump 1 the second main is believed as before."""
    recording = recorded(twin, SEED + 3, learnt[1])
    one, other = restored(twin, learnt[0]), restored(twin, learnt[0])
    assert told(one, recording) == told(other, recording)
    assert one.snapshot() == other.snapshot()
    one.rebaseline(0, learnt[1])
    assert [prior.system for prior in one._systems] == [0.05, other._systems[1].system]
    assert other._systems[1].system < 0.05


def test_a_snapshot_of_other_mains_is_refused(twin, learnt):
    mains = [main.model_copy(update={"delivery_level_m": 14.5}) for main in twin.mains]
    with pytest.raises(SnapshotError, match="the curves in the station file have changed since"):
        restored(twin.with_mains(mains), learnt[0])


def test_without_a_level_the_lift_to_a_delivery_level_is_not_known(twin):
    """Nothing is judged by a guess of it."""
    detector, recording = Detector(twin.name, datasheet_of(twin)), recorded(twin, SEED, 0)
    recording.columns["level_m"][:] = np.nan
    verdicts = [verdict for each in told(detector, recording).values() for verdict in each[1:]]
    assert {verdict.state for verdict in verdicts} == {"unknown"}
    assert {verdict.evidence["reason"] for verdict in verdicts} == {
        "without level_m pump and system cannot be told apart"
    }
    assert detector.baselines == (None,) * 4


def test_a_level_that_is_lost_is_a_sensor_fault(twin, learnt):
    recording = recorded(twin, SEED + 1, learnt[1])
    recording.columns["level_m"][:] = np.nan
    after = told(restored(twin, learnt[0]), recording)
    assert {verdict.state for each in after.values() for verdict in each[1:]} == {"sensor_fault"}


def test_a_level_that_falls_within_a_run_is_no_motion_of_the_main(twin):
    """The attribution index of healthy runs is that of a main with a fixed lift; the level is no part of it."""
    lift_m = 14.0 - twin.middle_level_m
    fixed = [main.model_copy(update={"delivery_level_m": None, "static_head_m": lift_m}) for main in twin.mains]

    def index(station):
        verdicts = told(Detector(station.name, datasheet_of(station)), recorded(station, SEED + 4, 0))
        evidence = [verdict.evidence for each in verdicts.values() for verdict in each]
        return np.median([each["tangent"]["value"] for each in evidence if "tangent" in each])

    assert index(twin) == pytest.approx(index(twin.with_mains(fixed)), abs=0.1)
