"""Episodes and maintenance in the historian: kept as they change, over restarts, gathered where none were kept."""

import contextlib

from wetwell.protocols.messages.history import Episode, History, HistoryQuery
from wetwell.protocols.messages.maintenance import MaintenanceRecord
from wetwell.protocols.messages.verdict import AssetFault, Severity, Verdict
from wetwell.services.batch.crews import score_history
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import Batch, EventRow


def verdict(time, value=None, *, is_old=False):
    fields = {"time": time, "station": "alpha", "pump": 1, "probability": {}, "evidence": {}, "window": (time, time)}
    fields["state"] = "normal" if value is None else "system_fault"
    if is_old:
        return Verdict.model_validate(fields).encode()
    severity = Severity(quantity="friction_rise_percent", value=value or 0.0, interval=(0.0, 1.0), limit=15.0)
    fault = AssetFault(asset="main", stage="act" if value and value > 15.0 else "plan", since=5, severity=severity)
    return Verdict.model_validate(fields | {"faults": () if value is None else (fault,)}).encode()


def asked(historian, kind, **span):
    answer = History.decode(historian.answer("alpha", HistoryQuery(kind=kind, **span).encode()))
    assert not answer.error
    return answer.messages


def test_an_episode_goes_on_over_a_restart_and_old_verdicts_that_come_again_change_nothing(tmp_path):
    told = [verdict(10, 9.0), verdict(20, 9.1), verdict(30, 16.0)]
    with contextlib.closing(FolderStore(tmp_path)) as store:
        historian = Historian(store)
        for payload in told:
            historian.handle("verdicts", payload)
        historian.commit(0)
    with contextlib.closing(FolderStore(tmp_path)) as store:
        historian = Historian(store)
        for payload in [*told, verdict(40, 12.0), verdict(50)]:
            historian.handle("verdicts", payload)
        historian.commit(0)
        (message,) = asked(historian, "episodes")
        episode = Episode.model_validate(message)
        assert (episode.asset, episode.stage, episode.since, episode.to) == ("main", "act", 5, 50)
        assert episode.severity.value == 16.0
        assert {"asset", "state", "stage", "from", "to", "severity", "advice", "cost"} <= message.keys()
        assert asked(historian, "episodes", start=51) == asked(historian, "episodes", end=5) == ()
        assert len(asked(historian, "episodes", start=49)) == len(asked(historian, "episodes", end=6)) == 1
        assert len(asked(historian, "verdicts")) == 5


def test_a_history_of_an_older_version_has_its_episodes_too(tmp_path):
    with contextlib.closing(FolderStore(tmp_path)) as store:
        told = ((10, 1.0), (20, 1.0), (30, None))
        rows = [EventRow("verdicts", "alpha", time, verdict(time, value, is_old=True)) for time, value in told]
        store.write(Batch(events=rows))
        (message,) = asked(Historian(store), "episodes")
        episode = Episode.model_validate(message)
        assert (episode.asset, episode.state, episode.since, episode.to) == ("main", "system_fault", 10, 30)


def test_the_log_of_maintenance_has_each_act_once_and_scores_the_episodes(tmp_path):
    with contextlib.closing(FolderStore(tmp_path)) as store:
        historian = Historian(store)
        for payload in (verdict(10, 16.0), verdict(50)):
            historian.handle("verdicts", payload)
        act = MaintenanceRecord(
            id="a", time=40, station="alpha", asset="main", act="flushed", found="deposits", by="ann"
        )
        for record in (act, act.model_copy(update={"result": "back"})):
            historian.handle("maintenance", record.encode())
        historian.commit(0)
        (message,) = asked(historian, "maintenance")
        assert (message["act"], message["result"]) == ("flushed", "back")
        score = score_history(store, "alpha")
        assert (score["hits"], score["recall"]) == (1, 1.0)
