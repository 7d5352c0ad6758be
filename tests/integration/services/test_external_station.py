"""Commands on a station with two mains that nobody's levels drive, recorded in means of 15 minutes without a head."""

import json

import numpy as np
import pytest
import tomli_w
from two_mains import recording, station, truth

from wetwell.protocols.recordings.recording import write_recording


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Recording and station file."""
    folder = tmp_path_factory.mktemp("inlet")
    rng = np.random.default_rng(41)
    write_recording(recording(rng, truth(rng), days=7.0), folder / "week.parquet")
    (folder / "station.toml").write_text(tomli_w.dumps(station().model_dump(exclude_none=True)), encoding="utf-8")
    return folder


@pytest.fixture
def fitted(run_wetwell, capsys, files):
    """The station file as the recording has it, made once, and what was told of it."""
    out, told = files / "fitted.toml", files / "told.json"
    if not told.exists():
        given = ("--recording", files / "week.parquet", "--station", files / "station.toml", "--out", out)
        told.write_text(json.dumps(asked(run_wetwell, capsys, "calibrate", *given)))
    return out, json.loads(told.read_text())


def asked(run_wetwell, capsys, *arguments):
    assert run_wetwell(*arguments, "--json") == 0
    return json.loads(capsys.readouterr().out)


def test_calibrate_tells_value_interval_prior_unit_and_reason(fitted):
    _, told = fitted
    rows = {row["name"]: row for row in told["parameters"]}
    row = rows["pump[5].head_scale"]
    assert row["low"] < row["value"] < row["high"]
    assert (row["prior"], row["prior_sd"], row["unit"]) == (1.0, 0.1, "")
    assert rows["control.ramp_s"]["low"] is None
    assert rows["control.ramp_s"]["reason"] == "a row every 900 s does not show a ramp of 10 s"
    assert not [name for name in rows if "levels" in name]
    assert rows["main[2].friction_h2_m5"]["unit"] == "h²/m⁵"


def test_validate_compares_row_by_row_beside_the_file_before(run_wetwell, capsys, files, fitted):
    path, _ = fitted
    told = asked(
        run_wetwell, capsys, "validate", "--recording", files / "week.parquet", "--station", path,
        "--before", files / "station.toml",
    )  # fmt: skip
    assert told["closed_loop"] == "control.mode 'external': no levels start pumps"
    rows = {(row["what"], row["quantity"]): row for row in told["row_by_row"]}
    flow = rows["all pumps", "flow_m3h"]
    assert flow["steady_median"] < 0.015
    assert flow["before_steady_median"] > 0.04
    assert rows["line 2", "power_kw"]["steady_median"] < 0.01
    assert not [what for what, quantity in rows if quantity == "head_m"]


def test_a_simulated_recording_of_a_station_without_levels_is_refused(run_wetwell, capsys, files, tmp_path):
    arguments = ("--recording", files / "week.parquet", "--station", files / "station.toml")
    assert run_wetwell("validate", *arguments, "--out", tmp_path / "simulated.parquet") == 2
    assert "control.mode 'external': there is no simulated recording" in capsys.readouterr().err
