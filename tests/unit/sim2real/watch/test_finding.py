"""What a watched station says to others: its own sizes, no faults, nothing before its first look."""

from wetwell.services.stations import find_station
from wetwell.sim2real.diagnosis.report import FittedParameter, FoundEffect
from wetwell.sim2real.watch.finding import finding_of
from wetwell.sim2real.watch.state import Called, KeptLook, WatchState

LOOK = KeptLook(start_ns=0, end_ns=9, gap={}, group="", matters=0.0, interval=(0.0, 0.0))


def effect(factor):
    parameters = {"factor": FittedParameter(value=factor, ci=(factor - 0.1, factor + 0.1), unit="1")}
    return FoundEffect(name="friction_bias", component="rising_main", equivalent=(), parameters=parameters)


def called(own, fault=None):
    fields = {"component": "rising_main", "probability": 0.9, "since_ns": None, "named_ns": 0, "span_s": 9.0}
    return Called(effect=effect(1.1), own=own, table=None, before={}, fault=fault, **fields)


def test_it_says_what_its_own_recordings_say():
    state = WatchState(
        station=find_station("alpha"),
        looks=(LOOK,),
        called=(called(effect(1.2)), called(effect(1.3), "main"), called(None)),
    )
    finding = finding_of(state)
    assert (finding.station, [one.parameters["factor"].value for one in finding.effects]) == ("alpha", [1.2])


def test_before_its_first_look_it_says_nothing():
    assert finding_of(WatchState(station=find_station("alpha"))) is None
