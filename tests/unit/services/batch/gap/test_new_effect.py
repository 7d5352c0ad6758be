"""The files of a new effect: they run as they come, and bad input is one line."""

import subprocess
import sys

import pytest

from wetwell.protocols.errors import ConfigError
from wetwell.protocols.station.station_file import EffectTable
from wetwell.services.batch.field_data import write_station
from wetwell.services.batch.gap.new_effect import new_effect

TABLE = {
    "name": "learnt_correction",
    "term": "head_loss",
    "offset": 0.05,
    "part": [
        {"covariate": "hour_of_day", "shape": "cosine", "size": 0.12, "centre": 5.0, "scale": 24.0},
        {
            "covariate": "column",
            "column": "rain_mm_h",
            "shape": "linear",
            "size": -0.1,
            "scale": 9.0,
            "low": 0.0,
            "high": 9.0,
        },
    ],
}


@pytest.fixture
def diagnosed(alpha, tmp_path):
    folder = tmp_path / "diagnosis"
    folder.mkdir()
    write_station(alpha.model_copy(update={"effect": (EffectTable(**TABLE),)}), folder / "station.toml")
    return folder


def test_what_is_written_passes_its_own_test(diagnosed, tmp_path):
    told = new_effect(diagnosed, "night_grease", tmp_path / "new")
    assert len(told["files"]) == 3
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(tmp_path / "new")],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stdout
    assert "2 passed" in done.stdout
    source = (tmp_path / "new" / "night_grease.py").read_text()
    assert "class NightGrease(Effect)" in source
    assert "head_loss × (1 + 0.05 + 0.12" in source
    assert "| `night_grease` | rising_main |" in (tmp_path / "new" / "night_grease.md").read_text()


@pytest.mark.parametrize(
    ("name", "rule"),
    [("Night", "--name: got 'Night', must be small letters"), ("friction_bias", "is in the library already")],
)
def test_a_bad_name_is_refused_in_one_line(diagnosed, tmp_path, name, rule):
    with pytest.raises(ConfigError, match=rule) as caught:
        new_effect(diagnosed, name, tmp_path / "new")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "new").exists()


def test_a_diagnosis_without_a_correction_is_refused_in_one_line(alpha, tmp_path):
    write_station(alpha, tmp_path / "station.toml")
    with pytest.raises(ConfigError, match="has no effect 'learnt_correction': the diagnosis has not taken one"):
        new_effect(tmp_path, "night_grease", tmp_path / "new")


def test_files_that_are_there_stay(diagnosed, tmp_path):
    new_effect(diagnosed, "night_grease", tmp_path / "new")
    with pytest.raises(ConfigError, match="is there already, give another folder"):
        new_effect(diagnosed, "night_grease", tmp_path / "new")
