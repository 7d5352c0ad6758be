"""Episodes scored against what crews found."""

from wetwell.protocols.messages.history import Episode
from wetwell.protocols.messages.maintenance import MaintenanceRecord
from wetwell.services.batch.crews import score_acts


def record(time, asset, found, result="back"):
    return MaintenanceRecord(
        id=str(time), time=time, station="s", asset=asset, act="pulled", found=found, by="ann", result=result
    )


def episode(asset, since, to, stage="act"):
    return Episode(time=since, station="s", asset=asset, state="pump_fault", stage=stage, since=since, to=to)


def test_each_outcome_is_counted_and_a_visit_without_a_look_is_not():
    episodes = [episode("pump:1", 10, 30), episode("main", 10, None, "plan"), episode("pump:2", 0, 99, "watch")]
    records = [
        record(20, "pump:1", "rags"),
        record(25, "main", " Nothing "),
        record(31, "pump:1", "rags"),
        record(40, "pump:2", "nothing", "no change"),
        record(50, "pump:2", ""),
    ]
    score = score_acts(records, episodes)
    assert {name: score[name] for name in ("hits", "false_calls", "missed", "quiet")} == {
        "hits": 1,
        "false_calls": 1,
        "missed": 1,
        "quiet": 1,
    }
    assert (score["precision"], score["recall"]) == (0.5, 0.5)
    assert score["results"] == {"back": 4, "no change": 1}
    assert [each["outcome"] for each in score["acts"]] == ["hits", "false_calls", "missed", "quiet"]


def test_an_empty_log_has_no_score():
    score = score_acts([], [episode("main", 0, None)])
    assert (score["precision"], score["recall"], score["acts"]) == (None, None, [])
