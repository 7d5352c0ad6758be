"""The detector on a healthy recording, with the station as configured and as corrected."""

from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import EffectTable
from wetwell.services.stations import find_scenario
from wetwell.sim2real.diagnosis.false_verdicts import false_verdicts
from wetwell.simulator.simulation import Simulation

LENGTH_S = 43_200
CLOGGED_S = 170_000
DAY_S = 86_400


def with_effect(station, **effect):
    return station.model_copy(update={"effect": (EffectTable.model_validate(effect),)})


def test_it_counts_what_the_detector_calls_a_fault(alpha):
    true = with_effect(alpha, name="friction_bias", factor=1.3)
    recording = Simulation(true, find_scenario("clogging"), 4).advance(CLOGGED_S, truth=False)
    last = slice(CLOGGED_S - DAY_S, None)
    recording = Recording(time_ns=recording.time_ns[last], columns={n: v[last] for n, v in recording.columns.items()})
    counted = false_verdicts(recording, alpha, true)
    assert counted.days == (DAY_S - 1) / DAY_S
    assert counted.has_new_curves
    assert 0 < counted.after <= counted.verdicts
    assert 0 < counted.before <= counted.verdicts


def test_an_effect_that_no_curve_shows_makes_no_difference(alpha):
    recording = Simulation(alpha, find_scenario("nominal"), 4).advance(LENGTH_S, truth=False)
    counted = false_verdicts(recording, alpha, with_effect(alpha, name="flow_meter_lag", lag_s=5.0))
    assert not counted.has_new_curves
    assert counted.verdicts > 10
    assert counted.before == counted.after == 0
