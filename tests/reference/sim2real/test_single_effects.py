"""Single effects on plants that are not ours, which an error of the model of the data has hidden once."""

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
    accepted = diagnose(recording, truth.station).attribution.accepted
    assert accepted is not None
    assert accepted.names == (effect,)
