"""A second run in a data folder goes on where the first ended, or gets a folder with a name of its own."""

import contextlib

import pytest

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.historian.samples import Samples
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import Batch
from wetwell.services.stations import find_scenario
from wetwell.services.supervisor.runs import RUN_FILE, RunRecord, take_folder
from wetwell.simulator.simulation import Simulation

HOUR_S = 3_600


def plant_of(station, scenario="demo", seed=1, start_ns=1_735_689_600 * NS_PER_S) -> Simulation:
    return Simulation(station, find_scenario(scenario), seed, start_ns)


def record_of(plant, seed=1, *, is_life=False) -> RunRecord:
    return RunRecord.of(plant, seed, is_life=is_life)


def keep(folder, recording) -> None:
    with contextlib.closing(FolderStore(folder)) as store:
        store.write(Batch(samples=Samples.of_recording(recording).rows("alpha")))


def test_the_same_run_goes_on_behind_its_last_sample(alpha, tmp_path) -> None:
    folder, plant = tmp_path / "first", plant_of(alpha)
    assert take_folder(folder, record_of(plant)).begin_s == 0
    told = plant.advance(HOUR_S, truth=False)
    keep(folder, told)
    again = take_folder(folder, record_of(plant_of(alpha)))
    assert (again.path, again.begin_s) == (folder, HOUR_S)
    assert "goes on where its history ended, at 2025-01-01T00:59:59Z" in again.words
    whole, resumed = plant_of(alpha).advance(2 * HOUR_S, truth=False), plant_of(alpha)
    resumed.advance(again.begin_s, truth=False)
    rest = resumed.advance(HOUR_S, truth=False)
    assert rest.time_ns[0] == told.time_ns[-1] + NS_PER_S
    assert rest.column("level_m").tobytes() == whole.column("level_m")[HOUR_S:].tobytes(), "as if it had never ended"


@pytest.mark.parametrize("change", [{"seed": 2}, {"scenario": "nominal"}])
def test_another_run_gets_a_folder_of_its_own_and_both_go_on_there(alpha, tmp_path, change) -> None:
    folder = tmp_path / "first"
    take_folder(folder, record_of(plant_of(alpha)))
    keep(folder, plant_of(alpha).advance(HOUR_S, truth=False))
    other = record_of(plant_of(alpha, **change), change.get("seed", 1))
    taken = take_folder(folder, other)
    assert (taken.path, taken.begin_s) == (tmp_path / "first-2", 0)
    assert "holds another run (station 'alpha', scenario 'demo', seed 1)" in taken.words
    keep(taken.path, plant_of(alpha, **change).advance(60, truth=False))
    assert take_folder(folder, other).begin_s == 60
    assert take_folder(folder, record_of(plant_of(alpha))).begin_s == HOUR_S


def test_a_folder_with_a_history_of_somebody_else_is_left_alone(alpha, tmp_path) -> None:
    folder = tmp_path / "site"
    keep(folder, plant_of(alpha).advance(60, truth=False))
    taken = take_folder(folder, record_of(plant_of(alpha)))
    assert taken.path == tmp_path / "site-2"
    assert "holds something else" in taken.words
    assert not (folder / RUN_FILE).exists()


def test_at_the_speed_of_life_a_history_goes_on_after_a_pause_and_never_back(alpha, tmp_path) -> None:
    folder, first_ns = tmp_path / "life", 1_800_000_000 * NS_PER_S
    take_folder(folder, record_of(plant_of(alpha, start_ns=first_ns), is_life=True))
    keep(folder, plant_of(alpha, start_ns=first_ns).advance(60, truth=False))
    later = take_folder(folder, record_of(plant_of(alpha, start_ns=first_ns + 900 * NS_PER_S), is_life=True))
    assert (later.path, later.begin_s) == (folder, 0)
    assert "goes on after a pause since 2027-01-15T08:00:59Z" in later.words
    with pytest.raises(ConfigError, match="which is not yet"):
        take_folder(folder, record_of(plant_of(alpha, start_ns=first_ns), is_life=True))


def test_a_record_that_cannot_be_read_is_refused_with_its_place(alpha, tmp_path) -> None:
    (tmp_path / RUN_FILE).write_text("{}")
    with pytest.raises(ConfigError, match=r"run\.json: station"):
        take_folder(tmp_path, record_of(plant_of(alpha)))
