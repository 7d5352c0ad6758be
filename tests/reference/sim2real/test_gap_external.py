"""Diagnosis of a station whose pumps nobody's levels start: the record is followed, controllers are no candidates."""

import pytest

from wetwell.protocols.station.station_file import Station
from wetwell.services.stations import find_station
from wetwell.sim2real.calibration.calibration import calibrate
from wetwell.sim2real.calibration.fitted_station import with_estimates
from wetwell.sim2real.calibration.validation import validate
from wetwell.sim2real.diagnosis.diagnosis import diagnose
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.scenario import Scenario
from wetwell.simulator.simulation import Simulation

HOURS = 8


@pytest.fixture(scope="module")
def recording():
    """The station with two mains under its own levels, of which the file that is diagnosed knows nothing."""
    scenario = Scenario(name="quiet", initial_level_m=-1.0)
    return Simulation(find_station("twin"), scenario, 21).advance(HOURS * 3600, truth=False)


@pytest.fixture(scope="module")
def external():
    table = find_station("twin").model_dump(exclude_none=True)
    return Station.model_validate(table | {"control": {"mode": "external"}})


def test_a_station_that_is_as_its_file_says_has_no_gap(recording, external):
    found = diagnose(recording, external)
    assert found.verdict == "none"
    controllers = {name for name, effect in EFFECTS.items() if effect.component == "controller"}
    assert controllers
    assert not controllers & {candidate.name for candidate in found.candidates}


def test_it_is_calibrated_and_only_the_free_run_is_refused(recording, external):
    estimates = calibrate(recording, external)
    assert not any("levels" in estimate.name for estimate in estimates)
    assert with_estimates(external, estimates).control.is_external
    with pytest.raises(ValueError, match="'external': no levels start pumps"):
        validate(recording, external)
