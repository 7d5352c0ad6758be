"""Free-running comparison of a simulator with a recording."""

from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from wetwell.protocols.recordings.recording import Recording, write_recording
from wetwell.services.batch.field_data import validate_file
from wetwell.services.stations import find_scenario
from wetwell.sim2real.calibration.comparison import compare
from wetwell.sim2real.calibration.validation import Validation, validate
from wetwell.simulator.simulation import Simulation

DAY_S = 86_400
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def recording(alpha):
    return Simulation(alpha, find_scenario("clogging"), 5).advance(DAY_S, truth=False)


def test_the_right_station_under_the_measured_inflow_agrees_in_starts_and_run_time(alpha, recording):
    result, simulated = validate(recording, alpha)
    assert result.inflow == "measured"
    assert result.days == ("2025-01-01",)
    assert np.abs(result.starts[0] - result.starts[1]).max() <= 1
    assert np.abs(result.run_h[0] - result.run_h[1]).max() < 0.1
    assert result.level_nmae < 0.1
    assert len(simulated) == len(recording)
    assert result.starts[0].sum() > 60


def test_means_are_held_against_means_of_the_free_run(alpha, recording):
    """A day of means of 15 minutes of a well that is emptied within minutes: instants say next to nothing of them."""
    step_s = 900
    means = {name: values.reshape(-1, step_s).mean(axis=1) for name, values in recording.columns.items()}
    slow = Recording(time_ns=recording.time_ns[step_s - 1 :: step_s], columns=means, station="alpha", value="mean")
    result, simulated = validate(slow, alpha)
    _, instants = validate(replace(slow, value="instant"), alpha)
    assert simulated.value == "mean"
    np.testing.assert_array_equal(simulated.time_ns, slow.time_ns)

    def error_m3h(told):
        flows = [f"pump{pump}_flow_m3h" for pump in (1, 2, 3)]
        return np.sqrt(np.mean((sum(told.column(name) for name in flows) - sum(means[name] for name in flows)) ** 2))

    assert error_m3h(simulated) < 0.4 * error_m3h(instants)
    assert result.run_h[0].sum() == pytest.approx(result.run_h[1].sum(), abs=0.1)


def test_errors_of_days_are_sums_of_differences_over_the_measured_sum():
    result = Validation(
        inflow="measured",
        level_nmae=0.1,
        days=("2025-01-01", "2025-01-02"),
        starts=np.array([[[10, 0], [30, 0]], [[12, 1], [28, 0]]]),
        run_h=np.array([[[2.0, 0.0], [2.0, 0.0]], [[1.0, 0.0], [2.0, 0.0]]]),
    )
    np.testing.assert_allclose(result.starts_nmae, [0.1, np.nan])
    np.testing.assert_allclose(result.run_h_nmae, [0.25, np.nan])


def test_the_page_draws_both_levels_and_every_pump(alpha, recording, tmp_path):
    source, out = tmp_path / "day.parquet", tmp_path / "page.html"
    write_recording(recording, source)
    printed = validate_file(alpha, source, None, None, out)
    assert printed["level_nmae"] < 0.1
    assert len(printed["starts_nmae"]) == 3
    root = ET.fromstring(out.read_text(encoding="utf-8").removeprefix("<!DOCTYPE html>\n"))  # noqa: S314
    titles = [chart.find(f"{SVG}title").text for chart in root.iter(f"{SVG}svg")]
    pumps = [f"Pump {pump}: {what}" for what in ("starts", "run time") for pump in (1, 2, 3)]
    assert titles == ["Level", "Level, the first six hours", *pumps]
    level = next(root.iter(f"{SVG}svg"))
    assert [path.get("d", "").count("L") > 500 for path in level.iter(f"{SVG}path")] == [True, True]
    cells = [cell.text for cell in root.iter("td")]
    assert cells[:2] == ["level, over its range", f"{printed['level_nmae']:.2%}"]
    assert len(cells) == 2 * 7


def test_without_a_measured_inflow_it_is_inferred(alpha, recording):
    kept = {name: values for name, values in recording.columns.items() if name != "inflow_m3h"}
    result, _ = validate(Recording(time_ns=recording.time_ns, columns=kept), alpha)
    assert result.inflow == "inferred"
    assert np.abs(result.starts[0] - result.starts[1]).max() <= 2


def test_a_wrong_station_shows(alpha, recording):
    wrong = alpha.model_copy(update={"sump": alpha.sump.model_copy(update={"area_m2": 16.0})})
    result, _ = validate(recording, wrong)
    assert result.starts[1].sum() < 0.7 * result.starts[0].sum()


def test_what_cannot_be_compared_is_said(alpha, recording):
    kept = {name: values for name, values in recording.columns.items() if name != "level_m"}
    blind = Recording(time_ns=recording.time_ns, columns=kept)
    with pytest.raises(ValueError, match="'level_m' has no values"):
        validate(blind, alpha)
    single = alpha.model_copy(update={"pump": alpha.pump[:1]})
    with pytest.raises(ValueError, match="the recording has 3 pumps, station 'alpha' 1"):
        validate(recording, single)


def test_row_by_row_the_right_station_misses_by_the_noise_of_the_meters_and_a_wrong_one_by_more(alpha):
    calm = Simulation(alpha, find_scenario("nominal"), 5).advance(6 * 3600, truth=False)
    told = {error.what: error for error in compare(calm, alpha).errors("flow_m3h")}
    assert told["pump 1"].steady_rms == pytest.approx(alpha.sensors.flow_noise, rel=0.1)
    assert abs(told["pump 1"].steady_bias) < 0.001
    rough = alpha.with_mains([alpha.mains[0].model_copy(update={"friction_h2_m5": 9.0e-4})])
    c0, c1, c2 = alpha.pump[0].coefficients
    duty_m3h = [max(np.roots([c2 - friction, c1, c0 - 2.0])) for friction in (6.0e-4, 9.0e-4)]
    wrong = {error.what: error for error in compare(calm, rough).errors("flow_m3h")}
    assert wrong["pump 1"].steady_bias == pytest.approx(duty_m3h[1] / duty_m3h[0] - 1.0, abs=0.002)


def test_a_mean_of_an_interval_with_a_start_in_it_is_told_by_its_share(quiet_alpha):
    """A quarter of an interval at full frequency: a quarter of the flow of the steady rows."""
    hz = np.array([0.0, 12.5, 50.0, 50.0, 50.0, 50.0, 20.0, 0.0])
    means = Recording(
        time_ns=np.arange(1, 9) * 900 * 10**9,
        columns={"level_m": np.ones(8)}
        | {f"pump{i}_frequency_hz": hz if i == 1 else np.zeros(8) for i in (1, 2, 3)}
        | {f"pump{i}_flow_m3h": np.zeros(8) for i in (1, 2, 3)},
        value="mean",
    )
    told = compare(means, quiet_alpha).told["flow_m3h"][0]
    assert told[3] > 100.0
    np.testing.assert_allclose(told / told[3], [0.0, 0.25, 1.0, 1.0, 1.0, 1.0, 0.4, 0.0])
