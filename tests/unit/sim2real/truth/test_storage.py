"""What a historian keeps: against sums and loops that are written here a second time."""

import numpy as np
import pytest

from wetwell.protocols.recordings.recording import Recording, read_recording, write_recording
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.sim2real.truth import truth_plant
from wetwell.sim2real.truth.case import START_NS, TruthCase
from wetwell.sim2real.truth.sampling import case_of, station_of
from wetwell.sim2real.truth.storage import EVERY_SECOND, Storage, storage_of, stored

SECONDS = 3601


@pytest.fixture(scope="module")
def recording():
    rng = np.random.default_rng(1)
    time_s = np.arange(SECONDS)
    running = (time_s % 700 > 300).astype(float)
    columns = {
        "level_m": 1.0 + np.cumsum(rng.normal(0.0, 1e-3, SECONDS)),
        "inflow_m3h": rng.uniform(80.0, 90.0, SECONDS),
        "pump1_frequency_hz": 50.0 * running,
        "pump1_flow_m3h": running * rng.normal(200.0, 2.0, SECONDS),
        "pump1_running": running,
    }
    truth = {"truth_level_m": columns["level_m"] + 1.0}
    return Recording(time_ns=START_NS + NS_PER_S * time_s, columns=columns, truth=truth, station="s")


def test_each_second_is_stored_as_it_is_unless_told_otherwise(recording):
    kept = stored(recording, EVERY_SECOND)
    assert kept.value == "instant"
    for name, values in recording.columns.items():
        np.testing.assert_array_equal(kept.columns[name], values)


def test_instants_are_those_of_the_stamps(recording):
    kept = stored(recording, Storage(every_s=60))
    np.testing.assert_array_equal(kept.time_ns, START_NS + 60 * NS_PER_S * np.arange(61))
    np.testing.assert_array_equal(kept.columns["pump1_flow_m3h"], recording.columns["pump1_flow_m3h"][::60])
    np.testing.assert_array_equal(kept.truth["truth_level_m"], recording.truth["truth_level_m"][::60])


@pytest.mark.parametrize("every_s", [2, 60, 900])
def test_a_mean_is_that_of_the_seconds_since_the_row_before(recording, every_s):
    kept = stored(recording, Storage(every_s=every_s, value="mean"))
    assert (kept.value, kept.station) == ("mean", "s")
    assert "pump1_running" not in kept.columns
    for row in (0, 1, len(kept) - 1):
        second = (kept.time_ns[row] - START_NS) // NS_PER_S
        assert second == (row + 1) * every_s
        for name in ("level_m", "pump1_frequency_hz"):
            since = recording.columns[name][second - every_s + 1 : second + 1]
            assert kept.columns[name][row] == pytest.approx(since.mean())


def test_a_mean_passes_over_missing_values_and_is_missing_without_any(recording):
    level_m = recording.columns["level_m"].copy()
    level_m[5:8] = level_m[61:121] = np.nan
    gappy = Recording(time_ns=recording.time_ns, columns={"level_m": level_m})
    mean_m = stored(gappy, Storage(every_s=60, value="mean")).columns["level_m"]
    assert mean_m[0] == pytest.approx(np.nanmean(level_m[1:61]))
    assert np.isnan(mean_m[1])
    assert np.isfinite(mean_m[2:]).all()


def test_a_held_value_moves_by_its_deadband_or_when_its_time_is_up(recording):
    storage = Storage(every_s=1, value="held", deadband={"level_m": 0.01}, report_s=300.0)
    held_m, level_m = stored(recording, storage).columns["level_m"], recording.columns["level_m"]
    assert np.abs(held_m - level_m).max() < 0.01
    sent = np.flatnonzero(np.diff(held_m)) + 1
    np.testing.assert_array_equal(held_m[sent], level_m[sent])
    moved = np.abs(np.diff(held_m)[sent - 1]) >= 0.01
    assert moved.sum() > 10
    assert 2 <= np.diff(sent).max() <= 300
    coarse = stored(recording, Storage(every_s=60, value="held", deadband={"level_m": 0.01}, report_s=300.0))
    np.testing.assert_array_equal(coarse.columns["level_m"], held_m[::60])


def test_values_are_whole_steps_and_flags_are_left_as_they_are(recording):
    kept = stored(recording, Storage(every_s=10, step={"level_m": 0.01, "flow_m3h": 0.5, "frequency_hz": 0.1}))
    for name, step in (("level_m", 0.01), ("pump1_flow_m3h", 0.5)):
        steps = kept.columns[name] / step
        np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
        assert np.abs(kept.columns[name] - recording.columns[name][::10]).max() <= 0.5 * step + 1e-9
    np.testing.assert_array_equal(kept.columns["inflow_m3h"], recording.columns["inflow_m3h"][::10])


def test_absent_signals_are_in_no_column(recording):
    kept = stored(recording, Storage(absent=("inflow_m3h", "flow_m3h")))
    assert set(kept.columns) == {"level_m", "pump1_frequency_hz", "pump1_running"}


def test_a_stored_recording_says_in_its_file_what_it_is(recording, tmp_path):
    for suffix in ("csv", "parquet"):
        path = tmp_path / f"r.{suffix}"
        write_recording(stored(recording, Storage(every_s=60, value="mean")), path)
        again = read_recording(path)
        assert (again.station, again.value) == ("s", "mean")


def test_half_of_the_historians_round_and_only_held_values_have_deadbands():
    draws = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        draws.append(storage_of(station_of("s", rng), rng, value="held" if seed % 2 else "mean"))
    assert 0.4 < np.mean([bool(storage.step) for storage in draws]) < 0.6
    for storage in draws:
        assert bool(storage.deadband) == np.isfinite(storage.report_s) == (storage.value == "held")
        assert storage.step.get("level_m", 0.01) in {0.001, 0.01}
        assert storage.inherent == (("report_by_exception",) if storage.value == "held" else ())


def test_wet_wells_are_so_large_that_slow_rows_lie_within_runs():
    shares = []
    for every_s in (1, 900):
        case = case_of((), "s", np.random.default_rng(11), seconds=2 * 86_400, every_s=every_s)
        running = truth_plant.run(case, truth=False).of_pumps("running") > 0.0
        intervals = running.reshape(len(running), -1, 900)
        is_whole = (intervals.all(axis=2) | ~intervals.any(axis=2)).all(axis=0) & intervals.any(axis=(0, 2))
        shares.append(is_whole.mean())
    assert shares[0] < 0.25
    assert shares[1] > 0.3


def test_the_oracle_is_stored_as_the_recording_is(alpha):
    storage = Storage(every_s=60, value="mean", absent=("head_m",))
    passage = truth_plant.passage_of(TruthCase(station=alpha, seconds=7200, storage=storage))
    recorded, oracle = passage.recording(truth=False), passage.oracle()
    np.testing.assert_array_equal(recorded.time_ns, oracle.time_ns)
    assert set(recorded.columns) == set(oracle.columns)
    assert "pump1_head_m" not in oracle.columns
