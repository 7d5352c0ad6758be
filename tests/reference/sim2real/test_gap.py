"""The diagnosis on recordings of the built-in simulator, whose effects it is told nothing of."""

from dataclasses import replace

import numpy as np
import pytest

from wetwell.protocols.errors import RecordingError
from wetwell.protocols.recordings.recording import Recording, read_recording, write_recording
from wetwell.protocols.station.materiality import Materiality
from wetwell.protocols.station.station_file import EffectTable, load_station
from wetwell.services.batch.gap.diagnosis import diagnose_file, replay_file
from wetwell.services.stations import find_scenario
from wetwell.sim2real.diagnosis.diagnosis import diagnose
from wetwell.sim2real.diagnosis.report import GapReport
from wetwell.simulator.simulation import Simulation

LENGTH_S = 21_600
MODERATE = {
    "friction_bias": {"factor": 1.25},
    "head_sensor_offset": {"offset_m": 0.8},
    "threshold_shift": {"start_m": 0.08},
    "flow_meter_gain": {"factor": 0.94},
    "water_inertia": {"inertia_s2_m2": 1200.0},
}

QUICK = ("friction_bias", "threshold_shift", "flow_meter_gain")
"""Of the pump side, the controller and a meter: the others are of `make long`."""


def record(station, effects=(), seconds=LENGTH_S, seed=11):
    tables = tuple(EffectTable.model_validate(effect) for effect in effects)
    true = station.model_copy(update={"effect": tables})
    return Simulation(true, find_scenario("nominal"), seed).advance(seconds, truth=False)


@pytest.fixture(scope="module")
def plain(alpha):
    return record(alpha)


def test_without_a_gap_it_is_silent(alpha, plain):
    told = diagnose(plain, alpha)
    assert (told.verdict, told.effects, told.where) == ("none", (), ())
    assert told.gap.before < 1.1


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.long) for name in MODERATE]
)
def test_a_single_effect_is_named_with_its_size(alpha, name):
    diagnosis = diagnose(record(alpha, [{"name": name, **MODERATE[name]}]), alpha)
    report = diagnosis.report()
    assert report.verdict == "effect"
    assert [effect.name for effect in report.effects] == [name]
    for parameter, value in MODERATE[name].items():
        assert report.effects[0].parameters[parameter].value == pytest.approx(value, rel=0.05)
    assert report.gap.shrinkage > 0.9
    assert report.where[0].component == report.effects[0].component
    assert diagnosis.station.effect[0].name == name
    assert GapReport.model_validate_json(report.model_dump_json(by_alias=True)) == report


def test_water_that_is_too_slow_to_matter_is_no_answer_but_in_the_station(alpha):
    """Each main has some inertia: what so little of it does in a start is less than what is allowed there."""
    friction, inertia = {"name": "friction_bias", "factor": 1.25}, {"name": "water_inertia", "inertia_s2_m2": 150.0}
    told = diagnose(record(alpha, [friction, inertia]), alpha)
    assert [effect.name for effect in told.effects] == ["friction_bias"]
    assert [effect.name for effect in told.report().companions] == ["water_inertia"]
    assert told.companions[0].parameters["inertia_s2_m2"].value == pytest.approx(150.0, rel=0.1)
    assert [effect.name for effect in told.station.effect] == ["friction_bias", "water_inertia"]
    assert told.gap.after == pytest.approx(1.0, abs=0.02)
    alone = diagnose(record(alpha, [friction, inertia]), alpha, without=["water_inertia"])
    assert (alone.companions, alone.gap.after > 1.03) == ((), True)


def test_losses_that_each_drive_has_are_no_answer_but_in_the_station(alpha):
    load = {"electrical": alpha.electrical.model_copy(update={"power_model": "load"})}
    station = alpha.model_copy(update=load)
    effects = [{"name": "friction_bias", "factor": 1.25}, {"name": "constant_losses", "losses_share": 0.06}]
    told = diagnose(record(station, effects), station)
    assert [effect.name for effect in told.effects] == ["friction_bias"]
    assert "constant_losses" not in {name for one in told.posterior for name in one.effects}
    (losses,) = (one for one in told.companions if one.name == "constant_losses")
    assert losses.parameters["losses_share"].value == pytest.approx(0.06, rel=0.1)
    assert "constant_losses" in [effect.name for effect in told.station.effect]


def test_what_does_not_matter_beside_the_inertia_is_not_told(alpha):
    """Alone a lag of two fifths of a second has to be .6 s long, to do what the water does as well."""
    late = {"name": "channel_delay", "channel": "flow_m3h", "delay_s": 0.4}
    told = diagnose(record(alpha, [late, {"name": "water_inertia", "inertia_s2_m2": 150.0}]), alpha)
    assert not {effect.name for effect in told.effects} & {"channel_delay", "flow_meter_lag"}


@pytest.mark.long
def test_a_weak_effect_beside_a_strong_one_is_named_too(alpha):
    ragging = {"name": "ragging", "speed_loss": 0.1, "growth_s": 200.0}
    cutoff = {"name": "flow_low_cutoff", "cutoff_m3h": 60.0}
    told = diagnose(record(alpha, [ragging, cutoff]), alpha)
    assert [effect.name for effect in told.effects] == ["ragging", "flow_low_cutoff"]
    assert told.effects[1].parameters["cutoff_m3h"].value == pytest.approx(60.0, rel=0.15)


@pytest.mark.long
def test_a_cutoff_of_a_second_or_two_a_ramp_is_told_beside_a_rougher_main(alpha):
    """What the rougher main explains in all is many times more, but not in these seconds."""
    main, cutoff = {"name": "friction_bias", "factor": 2.5}, {"name": "flow_low_cutoff", "cutoff_m3h": 60.0}
    told = diagnose(record(alpha, [main, cutoff], 2 * LENGTH_S), alpha)
    assert [effect.name for effect in told.effects] == ["friction_bias", "flow_low_cutoff"]


@pytest.mark.long
def test_a_delay_that_matters_to_nobody_is_not_told_beside_a_lag(alpha):
    lag = {"name": "flow_meter_lag", "lag_s": 6.0}
    delay = {"name": "channel_delay", "channel": "flow_m3h", "delay_s": 0.05}
    told = diagnose(record(alpha, [lag, delay]), alpha)
    assert [effect.name for effect in told.effects] == ["flow_meter_lag"]


def test_a_channel_that_is_sent_when_its_time_is_up_is_found(alpha):
    """With soft starters it hardly moves otherwise: its deadband is at least as wide as what was not sent before."""
    station = alpha.model_copy(update={"control": alpha.control.model_copy(update={"ramp_s": 1.0})})
    recording = record(station)
    names = [f"pump{i}_power_kw" for i in (1, 2, 3)]
    columns = recording.columns | {name: held(recording.columns[name], 3.0, 240) for name in names}
    told = diagnose(replace(recording, columns=columns), station)
    assert [effect.name for effect in told.effects] == ["report_by_exception"]
    low_kw, high_kw = told.effects[0].parameters["deadband"].ci
    assert low_kw < 3.0 < high_kw


def held(values, deadband, report_s):
    sent, since = values.copy(), 0
    for row in range(1, values.size):
        since += 1
        if abs(values[row] - sent[row - 1]) >= deadband or since >= report_s:
            since = 0
        else:
            sent[row] = sent[row - 1]
    return sent


@pytest.mark.long
def test_a_bench_in_the_sump_is_found(alpha):
    """Its edge is within a few centimetres, unlike a cone's wall."""
    bench = {"name": "sump_area_profile", "bottom_factor": 0.5, "height_m": 1.2, "exponent": 10.0}
    told = diagnose(record(alpha, [bench]), alpha)
    assert (told.verdict, [effect.name for effect in told.effects]) == ("effect", ["sump_area_profile"])
    assert told.effects[0].parameters["exponent"].value == pytest.approx(10.0, rel=0.2)
    assert told.gap.shrinkage > 0.9


def test_an_effect_that_the_library_lacks_is_unknown_at_its_component(alpha):
    recording = record(alpha, [{"name": "flow_meter_gain", "factor": 0.94}])
    told = diagnose(recording, alpha, without=["flow_meter_gain"])
    assert told.verdict == "unknown"
    assert told.effects == ()
    assert told.where[0].component == "flow_meter"


@pytest.mark.parametrize(
    ("head_share", "verdict"), [pytest.param(0.01, "effect", marks=pytest.mark.long), (0.1, "none")]
)
def test_what_matters_is_up_to_the_station(alpha, head_share, verdict):
    """A head that is .8 m off is a gap for those who care for a per cent, and none for a tenth of it."""
    station = alpha.model_copy(update={"materiality": Materiality(head_share=head_share)})
    diagnosis = diagnose(record(alpha, [{"name": "head_sensor_offset", "offset_m": 0.8}]), station)
    assert diagnosis.verdict == verdict
    assert sum(one.probability for one in diagnosis.posterior) == pytest.approx(1.0)
    assert (diagnosis.component_probability.get("head_sensor", 0.0) > 0.5) == (verdict == "effect")


def test_a_late_controller_is_not_taken_for_other_thresholds(alpha):
    recording = record(alpha, [{"name": "control_delay", "delay_s": 20.0}])
    told = diagnose(recording, alpha, without=["control_delay"])
    assert told.verdict == "unknown"
    assert told.where[0].component == "controller"


@pytest.mark.long
def test_a_late_frequency_is_no_late_controller(alpha):
    """What was switched, was switched before its record: at the configured levels."""
    recording = record(alpha, [{"name": "channel_delay", "channel": "frequency_hz", "delay_s": 12.0}])
    told = diagnose(recording, alpha)
    assert (told.verdict, [effect.name for effect in told.effects]) == ("effect", ["channel_delay"])
    assert told.effects[0].parameters["delay_s"].value == pytest.approx(12.0, abs=0.6)
    assert told.gap.by_signal["start_level"].after < 1.5


@pytest.mark.parametrize(
    "missing",
    [pytest.param(name, marks=pytest.mark.long) for name in ("inflow_m3h", "power_kw", "head_m")],
)
def test_it_works_without_a_channel(alpha, missing):
    recording = record(alpha, [{"name": "friction_bias", "factor": 1.3}])
    kept = {name: values for name, values in recording.columns.items() if not name.endswith(missing)}
    told = diagnose(replace(recording, columns=kept), alpha)
    assert told.verdict == "effect"
    (effect,) = told.effects
    assert "friction_bias" in {effect.name, *effect.equivalent}, "without a head a worn pump gives the same flows"


def test_columns_of_truth_change_nothing(alpha, plain):
    marked = replace(plain, truth={"truth_state": np.full(len(plain), "pump_fault")})
    assert diagnose(marked, alpha).report() == diagnose(plain, alpha).report()


def _rows(recording, rows):
    return Recording(time_ns=recording.time_ns[rows], columns={n: v[rows] for n, v in recording.columns.items()})


def _standing(recording):
    zero = {n: 0.0 * v if n.startswith("pump") else v for n, v in recording.columns.items()}
    return Recording(time_ns=recording.time_ns, columns=zero)


def _dry(recording):
    """Flow meters that lose their signal after an hour."""
    flows = [name for name in recording.columns if name.startswith("pump") and name.endswith("flow_m3h")]
    has_signal = np.arange(len(recording)) < 3600
    return replace(
        recording, columns=recording.columns | {name: has_signal * recording.columns[name] for name in flows}
    )


def _single(recording):
    return Recording(
        time_ns=recording.time_ns,
        columns={n: v for n, v in recording.columns.items() if not n.startswith(("pump2", "pump3"))},
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: _rows(r, slice(0, 900)), "is 900 s long, a diagnosis needs at least 1800 s"),
        (lambda r: _rows(r, slice(0, 0)), "has no rows"),
        (_standing, "has 0 starts of pumps"),
        (_dry, "^flow_m3h reads 0 times what this station gives: a meter without a signal, or no water$"),
        (_single, "the recording has 1 pumps, station 'alpha' 3"),
    ],
)
def test_what_cannot_be_diagnosed_is_said(alpha, plain, change, message):
    with pytest.raises(ValueError, match=message):
        diagnose(change(plain), alpha)


def test_a_name_that_is_not_in_the_library_is_refused(alpha, plain):
    with pytest.raises(ValueError, match="effect 'gravity' is not in the library"):
        diagnose(plain, alpha, without=["gravity"])


def test_the_command_writes_report_page_and_station(alpha, tmp_path):
    recording = tmp_path / "field.parquet"
    write_recording(record(alpha, [{"name": "head_sensor_offset", "offset_m": 0.8}]), recording)
    report = diagnose_file(alpha, [recording], tmp_path / "out", only=["head_sensor_offset", "friction_bias"])
    assert [effect.name for effect in report.effects] == ["head_sensor_offset"]
    assert GapReport.model_validate_json((tmp_path / "out" / "report.json").read_text(encoding="utf-8")) == report
    assert load_station(tmp_path / "out" / "station.toml").effect[0].name == "head_sensor_offset"
    told = report.detector
    assert told.verdicts > 0
    assert (told.has_new_curves, told.false_per_day_before) == (False, told.false_per_day_after)
    assert "<svg" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_nothing_is_written_where_nothing_can_be_diagnosed(alpha, plain, tmp_path):
    recording = tmp_path / "short.parquet"
    write_recording(_rows(plain, slice(0, 900)), recording)
    with pytest.raises(RecordingError, match=r"short\.parquet: the recording is 900 s long"):
        diagnose_file(alpha, [recording], tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("closed_loop", [False, True])
def test_a_replay_has_the_rows_and_columns_of_the_recording(alpha, plain, tmp_path, closed_loop):
    recording, out = tmp_path / "field.parquet", tmp_path / "predicted.parquet"
    write_recording(plain, recording)
    replay_file(alpha, recording, out, closed_loop=closed_loop)
    predicted = read_recording(out)
    assert np.array_equal(predicted.time_ns, plain.time_ns)
    assert set(predicted.columns) == set(plain.columns)
    if not closed_loop:
        running = plain.column("pump1_frequency_hz") == 50.0
        ratio = plain.column("pump1_flow_m3h")[running] / predicted.column("pump1_flow_m3h")[running]
        assert ratio.mean() == pytest.approx(1.0, abs=0.002)
