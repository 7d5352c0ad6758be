"""The Python API: the same as the command line, of whatever table, and quick to import."""

import subprocess
import sys

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import wetwell
from wetwell.detector.detector import Detector
from wetwell.detector.evaluation.methods.run_detector import RunDetector, state_of
from wetwell.detector.verdict.episodes import episodes_of
from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.protocols.messages.verdict import Verdict

NAMES = ["Station", "__version__", "backtest", "calibrate", "detect", "diagnose", "read", "simulate"]


@pytest.fixture(scope="module")
def day():
    """Six hours of learning, a blockage of pump 2, then a main that clogs."""
    return wetwell.simulate("alpha", "demo", days=0.6, seed=3)


@pytest.fixture(scope="module")
def found(day):
    return wetwell.detect(day, "alpha")


def test_every_name_is_there_and_nothing_else():
    assert wetwell.__all__ == NAMES
    assert set(NAMES) <= set(dir(wetwell))
    assert all(getattr(wetwell, name) is not None for name in NAMES)
    with pytest.raises(AttributeError, match="module 'wetwell' has no attribute 'detekt'"):
        _ = wetwell.detekt


def test_the_import_loads_nothing_else():
    heavy = {"asyncio", "numba", "numpy", "pandas", "pyarrow", "pydantic", "typer"}
    code = f"import sys, wetwell; print([name for name in sys.modules if name in {heavy} or 'wetwell.' in name])"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == "[]\n"


def _by_duckdb(day):
    rows = day.to_arrow()  # noqa: F841 - DuckDB finds it by its name
    return duckdb.sql("select * from rows")


TAKEN = {"pandas": lambda day: day.to_pandas(), "polars": pl.DataFrame, "arrow": pa.table, "duckdb": _by_duckdb}


@pytest.mark.parametrize("library", TAKEN)
def test_any_table_is_taken_as_the_file_is(library, day, tmp_path):
    path = tmp_path / "day.parquet"
    day.write(path)
    again, written = wetwell.read(TAKEN[library](day)), wetwell.read(path)
    assert (again.time_ns == written.time_ns).all()
    assert again.columns == written.columns
    for name in written.recording.columns:
        assert again[name].tobytes() == written[name].tobytes(), name


def test_verdicts_are_those_of_the_command_line(day, found, tmp_path, run_wetwell):
    path, out = tmp_path / "day.parquet", tmp_path / "verdicts.jsonl"
    day.write(path)
    assert run_wetwell("detect", path, "--station", "alpha", "--out", out) == 0
    assert tuple(Verdict.model_validate_json(line) for line in out.read_text().splitlines()) == found.verdicts


def test_episodes_say_what_was_wrong_and_when(day, found):
    begin_ns = int(day.time_ns[day["truth_fault"].astype(str) == "blockage"][0])
    first = found.episodes[0]
    assert (first.asset, first.state) == ("pump:2", "pump_fault")
    assert abs(first.since - begin_ns) < 3600 * 10**9
    assert any(episode.asset == "main" for episode in found.episodes)
    assert list(found.episodes) == episodes_of(found.verdicts)


def test_results_show_themselves(day, found, tmp_path):
    table = found.to_arrow()
    assert table.num_rows == len(found.verdicts)
    assert pl.DataFrame(found).columns == table.column_names
    assert "<td>pump:2</td><td>pump_fault</td>" in found._repr_html_()
    picture = found.plot()
    assert "pump:2: " in picture.svg
    picture.save(tmp_path / "shift.svg")
    assert (tmp_path / "shift.svg").read_text() == picture.svg
    assert "pump2_flow_m3h" in day.plot("pump1_flow_m3h", "pump2_flow_m3h").svg
    assert "51840 rows" in repr(day)


def test_an_error_names_the_place_and_the_rule():
    with pytest.raises(RecordingError, match="table of polars: column 'time' is missing"):
        wetwell.read(pl.DataFrame({"level_m": [1.0]}))
    with pytest.raises(RecordingError, match=r"table of pandas: has 1 pumps, station 'alpha' has 3"):
        wetwell.detect(pd.DataFrame({"time": ["2025-01-01T00:00:00Z"], "pump1_flow_m3h": [1.0]}), "alpha")
    with pytest.raises(TypeError, match="recording: got list, must be a path, or a table"):
        wetwell.read([1, 2])  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="station 'nosuch' is neither a file nor one of alpha"):
        wetwell.detect("x.csv", "nosuch")
    with pytest.raises(ConfigError, match="days: got -1, must be positive"):
        wetwell.simulate("alpha", days=-1)
    with pytest.raises(ConfigError, match="effect 'rust' is not in the library"):
        wetwell.diagnose("x.csv", "alpha", only=["rust"])


def test_calibrate_finds_the_friction_that_the_plant_has(tmp_path):
    plant = wetwell.Station.model_validate(
        {
            "name": "north",
            "sump": {"area_m2": 6.5},
            "pump": [{"curve": [36.0, -0.02333, -1.3333e-4]}, {"curve": [36.0, -0.02333, -1.3333e-4]}],
            "rising_main": {"static_head_m": 3.0, "friction_h2_m5": 7.0e-4},
        }
    )
    guess = plant.with_mains([plant.mains[0].model_copy(update={"friction_h2_m5": 6.0e-4})])
    fitted = wetwell.calibrate(wetwell.simulate(plant, days=0.5, seed=4), guess)
    assert fitted.station.mains[0].friction_h2_m5 == pytest.approx(7.0e-4, rel=0.03)
    assert "friction_h2_m5" in fitted._repr_html_()
    assert fitted.to_arrow().num_rows == len(fitted.estimates)
    assert "svg" in fitted.plot().svg
    fitted.write(tmp_path / "fitted.toml")
    assert wetwell.Station is type(fitted.station)


def test_diagnose_names_the_effect_that_the_plant_has(tmp_path):
    effect = {"name": "flow_meter_gain", "factor": 1.12}
    plant = wetwell.Station.model_validate(
        {
            "name": "north",
            "sump": {"area_m2": 8.0},
            "pump": [{"curve": [36.0, -0.02333, -1.3333e-4]}],
            "effect": [effect],
        }
    )
    model = plant.model_copy(update={"effect": ()})
    told = wetwell.diagnose(wetwell.simulate(plant, days=0.25, seed=5), model, only=["flow_meter_gain", "motor_slip"])
    assert told.verdict == "effect"
    assert [one.name for one in told.effects] == ["flow_meter_gain"]
    assert told.report.gap.after < told.report.gap.before
    assert "flow_meter_gain" in told._repr_html_()
    assert told.to_arrow().num_rows == len(told.report.candidates)
    assert "svg" in told.plot().svg
    told.write(tmp_path / "north.toml")
    assert 'name = "flow_meter_gain"' in (tmp_path / "north.toml").read_text()


class ThreeSigma(RunDetector):
    """A method of one's own: the mean residual of a run against the spread of the runs that were learnt."""

    def learn(self, pump, runs):
        means = np.array([run.segments.residual_m.mean(axis=0) for run in runs])
        self.healthy = {**getattr(self, "healthy", {}), pump: (means.mean(axis=0), 3 * means.std(axis=0))}

    def told(self, run):
        centre, width = self.healthy[run.pump]
        pump, system = abs(run.segments.residual_m.mean(axis=0) - centre) > width
        return state_of(pump=pump, system=system)


def test_a_method_of_ones_own_stands_beside_ours(day):
    methods = {"wetwell": Detector, "mine": ThreeSigma}
    scores = wetwell.backtest([day], "alpha", methods)
    by_name = {row["method"]: row for row in scores.to_arrow().to_pylist()}
    assert by_name["wetwell"]["runs"] == by_name["mine"]["runs"] > 20
    assert by_name["wetwell"]["macro_f1"] >= by_name["mine"]["macro_f1"] > 0.5
    assert "mine" in scores._repr_html_()
    assert "mine" in scores.plot().svg
    named = wetwell.backtest([day], "alpha", ["wetwell"])
    assert named.figures["wetwell"]["confusion"] == scores.figures["wetwell"]["confusion"]


def test_the_truth_must_be_there(day):
    bare = day.to_pandas().drop(columns=[name for name in day.columns if name.startswith("truth_")])
    with pytest.raises(RecordingError, match="recording 1: column 'truth_pump1_state' is missing"):
        wetwell.backtest([bare], "alpha")
    with pytest.raises(TypeError, match="recordings: got one, must be a list"):
        wetwell.backtest(day, "alpha")
