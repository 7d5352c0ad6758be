"""Verdicts gathered to episodes."""

import pytest

from wetwell.detector.verdict.episodes import EpisodeLog, episodes_of
from wetwell.protocols.messages.verdict import AssetFault, Severity, Verdict


def fault(asset, value, stage="plan", since=5):
    severity = Severity(quantity="friction_rise_percent", value=value, interval=(value, value), limit=15.0)
    return AssetFault(asset=asset, stage=stage, since=since, severity=severity, advice="flush it")


def verdict(time, *faults, pump=1, state="normal", wait=None, told=True):
    evidence = {} if wait is None else {"cost": {"expected": {"wait": wait}}}
    fields = {"time": time, "station": "s", "pump": pump, "state": state, "probability": {}, "evidence": evidence}
    return Verdict.model_validate(fields | {"window": (time, time)} | ({"faults": faults} if told else {}))


def test_an_episode_has_the_worst_of_its_fault_and_ends_with_it():
    told = [
        verdict(10, fault("main", 4.0, "watch"), wait=100.0),
        verdict(20, fault("main", 16.0, "act"), pump=2, wait=900.0),
        verdict(30, fault("main", 9.0, "plan"), wait=300.0),
        verdict(40),
    ]
    (episode,) = episodes_of(told)
    assert (episode.asset, episode.state, episode.stage) == ("main", "system_fault", "act")
    assert (episode.since, episode.to) == (5, 40)
    assert (episode.severity.value, episode.cost, episode.advice) == (16.0, 900.0, "flush it")


def test_a_verdict_ends_only_what_it_speaks_of():
    told = [verdict(10, fault("pump:1", 4.0), fault("main", 8.0)), verdict(20, fault("main", 8.0), pump=2)]
    assert [(episode.asset, episode.to) for episode in episodes_of(told)] == [("pump:1", None), ("main", None)]
    told.append(verdict(30, pump=2))
    assert [(episode.asset, episode.to) for episode in episodes_of(told)] == [("pump:1", None), ("main", 30)]


def test_unknown_of_an_older_sender_neither_begins_nor_ends():
    told = [verdict(10, state="pump_fault", told=False), verdict(20, state="unknown", told=False)]
    (episode,) = episodes_of(told)
    assert (episode.asset, episode.stage, episode.to) == ("pump:1", "act", None)
    (episode,) = episodes_of([*told, verdict(30, told=False)])
    assert episode.to == 30


def test_growth_is_news_by_a_tenth_of_the_limit_however_slowly_it_came():
    log = EpisodeLog()
    news = [log.add(verdict(time, fault("main", 4.0 + 0.2 * time))) for time in range(10, 40)]
    assert [len(each) for each in news].count(1) == 1 + 3
    assert log.add(verdict(39, fault("main", 99.0))) != []
    assert log.add(verdict(12)) == [], "an older verdict changes nothing"


@pytest.mark.parametrize("cut", range(1, 6))
def test_a_log_goes_on_where_another_stopped(cut):
    told = [verdict(time, *([fault("main", float(time))] if 10 < time < 50 else [])) for time in range(10, 70, 10)]
    whole, first = EpisodeLog(), EpisodeLog()
    all_news = [episode for one in told for episode in whole.add(one)]
    news = [episode for one in told[:cut] for episode in first.add(one)]
    second = EpisodeLog(first.standing.values(), told[cut - 1].time)
    news += [episode for one in told[max(cut - 2, 0) :] for episode in second.add(one)]
    assert {(one.asset, one.since, one.to) for one in news} == {(one.asset, one.since, one.to) for one in all_news}
