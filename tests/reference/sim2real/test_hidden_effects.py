"""Effects on plants that are not ours, which an error of the model of the data has hidden once."""

import pytest

from wetwell.services.trial.material_case import material_case
from wetwell.sim2real.diagnosis.diagnosis import diagnose
from wetwell.sim2real.trial.cases import StoragePlan, trial_case

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


def hidden(what, kind, seed, plant, *names, marks=pytest.mark.long):
    return pytest.param(kind, seed, plant, names, id=what, marks=marks)


@pytest.mark.parametrize(
    ("kind", "seed", "plant", "names"),
    [
        hidden("a lag behind steps of a centimetre", "pair", 8204, "fine", "air_pocket", "level_sensor_lag"),
        hidden("steps of 16 mm", "pair", 8207, "elastic", "level_dependent_static_head", "level_quantisation"),
        hidden("rags of two kinds beside a lift", "pair", 8206, "elastic", "ragging", "static_head_bias"),
        hidden(
            *("a supply whose swing is no sine", "triple", 8648, "elastic"),
            *("flow_meter_gain", "level_sensor_lag", "supply_voltage_variation"),
        ),
        hidden(
            *("a friction that a meter hides, whose start leads away alone", "triple", 8661, "fine"),
            *("flow_meter_gain", "friction_bias", "threshold_shift"),
            marks=(),
        ),
    ],
)
def test_all_effects_are_told(kind, seed, plant, names):
    storage = StoragePlan(rates_s=(1,), metered_share=0.5)
    case = trial_case(seed, 0, kinds=(kind,), plants=(plant,), seconds=SECONDS, storage=storage)
    _, truth, recording = material_case(case)
    assert tuple(sorted(one.name for one in diagnose(recording, truth.station).effects)) == names
