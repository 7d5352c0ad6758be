"""Effects on plants that are not ours, which an error of the model of the data has hidden once."""

import pytest

from wetwell.services.trial.material_case import material_case
from wetwell.sim2real.diagnosis.diagnosis import diagnose
from wetwell.sim2real.trial.cases import StoragePlan, TrialCase, trial_case

SECONDS = 43_200


@pytest.mark.parametrize(
    ("seed", "effect", "metered_share"),
    [
        pytest.param(7001, "air_pocket", 1.0, id="air that has gathered before the recording"),
        pytest.param(7001, "air_pocket", 0.0, id="the same without an inflow meter"),
        pytest.param(7005, "report_by_exception", 0.0, id="a level that rain holds within its deadband"),
        pytest.param(7031, "report_by_exception", 0.0, id="another one"),
    ],
)
def test_a_single_effect_is_told(seed, effect, metered_share):
    storage = StoragePlan(rates_s=(1,), metered_share=metered_share)
    case = trial_case(
        seed, 0, kinds=("single",), plants=("fine",), seconds=SECONDS, storage=storage, effects=(effect,)
    )
    _, truth, recording = material_case(case)
    assert [one.name for one in diagnose(recording, truth.station).effects] == [effect]


def hidden(what, kind, seed, plant, *names, has_meter=False, marks=pytest.mark.long):
    absent = () if has_meter else ("inflow_m3h",)
    case = TrialCase(seed=seed, number=0, kind=kind, plant=plant, names=names, seconds=SECONDS, absent=absent)
    return pytest.param(case, id=what, marks=marks)


@pytest.mark.parametrize(
    "case",
    [
        hidden("a lag behind steps of a centimetre", "pair", 8204, "fine", "air_pocket", "level_sensor_lag"),
        hidden("steps of 16 mm", "pair", 8207, "elastic", "level_quantisation", "level_dependent_static_head"),
        hidden(
            *("rags of two kinds beside a lift", "pair", 8206, "elastic", "static_head_bias", "ragging"),
            has_meter=True,
        ),
        hidden(
            *("a supply whose swing is no sine", "triple", 8648, "elastic"),
            *("level_sensor_lag", "supply_voltage_variation", "flow_meter_gain"),
        ),
        hidden(
            *("a friction that a meter hides, whose start leads away alone", "triple", 8661, "fine"),
            *("friction_bias", "flow_meter_gain", "threshold_shift"),
            marks=(),
        ),
    ],
)
def test_all_effects_are_told(case):
    _, truth, recording = material_case(case)
    assert {one.name for one in diagnose(recording, truth.station).effects} == {*case.names}


@pytest.mark.parametrize("seed", [11300, 11306])
def test_foam_is_something_unknown_at_the_level_sensor(seed):
    """Without an inflow meter an inflow may do all that foam does, but for letting the level fall at rest."""
    case = TrialCase(
        seed=seed, number=0, kind="open", plant="fine", names=("foam",), seconds=SECONDS, absent=("inflow_m3h",)
    )
    _, truth, recording = material_case(case)
    told = diagnose(recording, truth.station)
    assert told.verdict == "unknown"
    assert told.where[0].component == "level_sensor"
    assert any("while no pump runs" in remark for remark in told.remarks)


def test_something_unknown_is_placed_by_what_the_inertia_of_the_water_leaves():
    """Each main has some: it moves more of the readings than the coarse steps of the level do, and is too small."""
    case = TrialCase(
        seed=11498, number=0, kind="leave_one_out", plant="elastic", names=("level_quantisation",), seconds=SECONDS
    )
    _, truth, recording = material_case(case)
    told = diagnose(recording, truth.station, without=case.without)
    assert told.verdict == "unknown"
    assert told.where[0].component == "level_sensor"
