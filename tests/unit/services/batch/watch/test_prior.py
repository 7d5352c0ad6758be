"""Priors of a fleet in files: from reports and watched gaps, the newest of a station, wrong files told in a line."""

import json
import os

import pytest

from wetwell.protocols.errors import ConfigError
from wetwell.services.batch.watch.prior import prior_of_folders, prior_rows, read_prior, write_prior
from wetwell.services.stations import find_station
from wetwell.services.watch.state_file import WatchFile
from wetwell.sim2real.diagnosis.report import FittedParameter, FoundEffect
from wetwell.sim2real.watch.state import Called, KeptLook, WatchState

LOOK = KeptLook(start_ns=0, end_ns=9, gap={}, group="", matters=0.0, interval=(0.0, 0.0))


def friction(factor):
    parameters = {"factor": FittedParameter(value=factor, ci=(factor - 0.02, factor + 0.02), unit="1")}
    return FoundEffect(name="friction_bias", component="rising_main", equivalent=(), parameters=parameters)


def report(folder, station, factor, **fields):
    folder.mkdir(parents=True)
    gap = {"before": 2, "after": 1, "floor": 1, "shrinkage": 1, "shrinkage_ci": [1, 1], "by_signal": {}}
    table = {
        "station": station,
        "verdict": "effect",
        "where": [],
        "effects": [friction(factor).model_dump(mode="json")],
        "candidates": [],
        "gap": gap,
        "closed_loop": None,
        "signals": [],
        "cycles": 40,
        "next_experiment": "",
    }
    (folder / "report.json").write_text(json.dumps({"schema": "wetwell.gap-report/2"} | table | fields))
    return folder / "report.json"


def watched(folder, station, factor):
    plant = find_station("alpha").model_copy(update={"name": station})
    one = Called(
        effect=friction(9.0),
        own=friction(factor),
        table=None,
        component="rising_main",
        probability=0.9,
        since_ns=None,
        named_ns=0,
        span_s=9.0,
        before={},
    )
    WatchFile(folder, plant).save(WatchState(station=plant, looks=(LOOK,), called=(one,)))


@pytest.fixture
def fleet(tmp_path):
    for number, factor in enumerate((1.18, 1.2, 1.22)):
        report(tmp_path / f"diagnosis-{number}", f"s{number}", factor)
    (tmp_path / "state").mkdir()
    watched(tmp_path / "state", "s3", 1.2)
    return tmp_path


def test_reports_and_watched_gaps_make_one_prior(fleet):
    prior = prior_of_folders([fleet])
    one = prior.parameters["friction_bias"]["factor"]
    assert (prior.stations, one.stations) == (4, 4)
    assert one.mean == pytest.approx(1.2, abs=0.01)
    rows = prior_rows(prior)
    assert [row["effect"] for row in rows["effects"]] == ["friction_bias"]


def test_of_a_station_the_newest_counts(fleet):
    older = report(fleet / "older", "s0", 9.0)
    os.utime(older, ns=(1, 1))
    assert prior_of_folders([fleet]).parameters["friction_bias"]["factor"].mean < 1.3


def test_a_report_with_a_prior_is_no_witness(fleet):
    report(fleet / "told", "s9", 1.9, prior_stations=4)
    assert prior_of_folders([fleet]).stations == 4


def test_the_station_that_is_diagnosed_is_left_out(fleet):
    assert prior_of_folders([fleet], without="s3").stations == 3


def test_it_is_written_and_read(fleet):
    prior = prior_of_folders([fleet])
    write_prior(prior, fleet / "prior.json")
    assert read_prior(fleet / "prior.json") == prior


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("report.json", "{}", "station: missing"),
        ("s.gap.json", "{}", "checksum"),
        ("report.json", "no", "report.json"),
    ],
)
def test_a_file_that_is_none_is_told_with_its_place(tmp_path, name, text, said):
    (tmp_path / name).write_text(text)
    with pytest.raises(ConfigError, match=said) as caught:
        prior_of_folders([tmp_path])
    assert str(tmp_path / name) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_empty_folder_and_a_missing_prior_are_told(tmp_path):
    with pytest.raises(ConfigError, match="must hold reports"):
        prior_of_folders([tmp_path])
    with pytest.raises(ConfigError, match="cannot be read"):
        read_prior(tmp_path / "no.json")
    (tmp_path / "odd.json").write_text('{"stations": -1}')
    with pytest.raises(ConfigError, match=r"odd\.json"):
        read_prior(tmp_path / "odd.json")
