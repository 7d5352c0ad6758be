"""Columns of a user on their way: export, recording, seconds, replay."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.recordings.importers.conversion import convert
from wetwell.protocols.recordings.importers.mapping import load_mapping
from wetwell.protocols.recordings.recording import read_recording, write_recording
from wetwell.protocols.station.station_file import EffectTable
from wetwell.sim2real.recording.excerpt import excerpt
from wetwell.sim2real.recording.preparation import Preparation, prepare
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.simulator.corrections.parts import TERMS
from wetwell.simulator.effects import effects_of
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

RAIN = "covariate_rain_mm_h"


@pytest.fixture(scope="module")
def recording(quiet_alpha):
    made = Simulation(quiet_alpha, Scenario(name="hours", initial_level_m=1.5), seed=4).advance(14_400)
    rain = 5.0 + 5.0 * np.sin(np.arange(14_400) / 900.0)
    return replace(made, columns={**made.columns, RAIN: rain}, truth={})


def with_effect(station, **table):
    return station.model_copy(update={"effect": (EffectTable(name="learnt_correction", **table),)})


def rain_part(size=0.2):
    table = {"covariate": "column", "column": "rain_mm_h", "shape": "linear", "size": size}
    return table | {"centre": 5.0, "scale": 5.0, "low": 0.0, "high": 10.0}


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz", ".parquet"])
def test_files_keep_them(recording, suffix, tmp_path):
    path = tmp_path / f"r{suffix}"
    write_recording(recording, path)
    again = read_recording(path)
    assert list(again.covariates) == ["rain_mm_h"]
    np.testing.assert_allclose(again.covariates["rain_mm_h"], recording.columns[RAIN], rtol=1e-12)
    assert again.pumps == 3
    assert prepare(again, Preparation())[0].covariates.keys() == {"rain_mm_h"}


def test_convert_makes_them_of_a_tag(tmp_path):
    rows = "".join(f"2025-01-06T00:{k:02}:00Z;{200 + k};{k / 10:.1f};{150 + k}\n" for k in range(60))
    (tmp_path / "e.csv").write_text("time;FT;RAIN;RIVER\n" + rows)
    (tmp_path / "m.toml").write_text(
        'station = "north"\nlayout = "wide"\n[columns]\ntime = "time"\n'
        '[signal.pump1_flow_m3h]\ntag = "FT"\n[signal.covariate_rain_mm_h]\ntag = "RAIN"\nscale = 2.0\n'
        '[signal.covariate_river_level_m]\ntag = "RIVER"\nunit = "cm"\n'
    )
    made = convert([tmp_path / "e.csv"], load_mapping(tmp_path / "m.toml")).recording
    np.testing.assert_allclose(made.covariates["rain_mm_h"], np.arange(60) / 5.0)
    np.testing.assert_allclose(made.covariates["river_level_m"], 1.5 + np.arange(60) / 100.0)


@pytest.mark.parametrize("name", ["rain", "covariate_Rain", "covariate_"])
def test_a_mapping_says_what_a_column_may_be_called(name, tmp_path):
    path = tmp_path / "m.toml"
    signals = f'[signal.{name}]\ntag = "A"\n[signal.pump1_flow_m3h]\ntag = "B"\n'
    path.write_text('station = "n"\nlayout = "wide"\n[columns]\ntime = "t"\n' + signals)
    with pytest.raises(ConfigError, match=f"signal.{name}: is no column of a recording.*covariate_ with a name such"):
        load_mapping(path)


def test_seconds_between_rows_have_a_value(recording, quiet_alpha):
    every = slice(0, None, 10)
    slow = replace(
        recording,
        time_ns=recording.time_ns[every],
        columns={name: values[every] for name, values in recording.columns.items()},
    )
    course = traces_of(slow, quiet_alpha).columns["rain_mm_h"]
    np.testing.assert_allclose(course, recording.columns[RAIN][: course.size], atol=1e-3)
    part = excerpt(traces_of(recording, quiet_alpha), 7200)
    assert part.columns["rain_mm_h"].size == part.seconds


def test_a_replay_goes_by_them_and_refuses_to_without(recording, quiet_alpha):
    station = with_effect(quiet_alpha, term="flow_reading", part=[rain_part()])
    traces = traces_of(recording, quiet_alpha)
    plain = Replay(traces, quiet_alpha).run().signals["flow_m3h"]
    ours = Replay(traces, station, effects_of(station)).run().signals["flow_m3h"]
    at = plain[0] > 10.0
    expected = 1.0 + 0.2 * (traces.columns["rain_mm_h"] - 5.0) / 5.0
    np.testing.assert_allclose((ours[0] / np.where(at, plain[0], 1.0))[at], expected[at], rtol=1e-9)
    without = replace(recording, columns={name: v for name, v in recording.columns.items() if name != RAIN})
    with pytest.raises(ValueError, match="column 'covariate_rain_mm_h' is missing, or most of its rows are empty"):
        Replay(traces_of(without, quiet_alpha), station, effects_of(station))


@pytest.mark.parametrize("term", TERMS)
def test_a_replay_of_what_the_simulator_made_leaves_nothing(term, quiet_alpha):
    """The replay and the simulator mean the same by a correction, whatever it goes by."""
    parts = [
        {"covariate": "since_start_s", "shape": "decay", "size": -0.05, "scale": 90.0, "low": 0.0, "high": 600.0},
        {"covariate": "hour_of_day", "shape": "cosine", "size": 0.05, "centre": 1.0, "scale": 4.0},
        {"covariate": "level_m", "shape": "linear", "size": 0.05, "centre": 1.0, "low": 0.5, "high": 2.0},
    ]
    station = with_effect(quiet_alpha, term=term, offset=0.02, part=parts)
    made = Simulation(station, Scenario(name="hours", initial_level_m=1.5), seed=4).advance(14_400)
    traces = traces_of(made, station)
    right = Replay(traces, station, effects_of(station)).run()
    plain = Replay(traces, quiet_alpha).run()
    left, before = 0.0, 0.0
    for name, recorded in traces.signals.items():
        scale = np.nanmax(recorded)
        left += float(np.nanmean(((recorded - right.signals[name]) / scale) ** 2))
        before += float(np.nanmean(((recorded - plain.signals[name]) / scale) ** 2))
    left += float(np.nanmean((traces.level_m - right.level_m) ** 2))
    before += float(np.nanmean((traces.level_m - plain.level_m) ** 2))
    assert left < 0.02 * before
