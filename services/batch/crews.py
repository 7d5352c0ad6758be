"""Verdicts of a history scored against what crews found."""

from collections.abc import Sequence
from typing import Any

from wetwell.protocols.messages.history import LONGEST_NS, Episode
from wetwell.protocols.messages.maintenance import NOTHING, MaintenanceRecord
from wetwell.protocols.timestamps import to_iso
from wetwell.services.historian.episodes import episodes_between
from wetwell.services.historian.store.interface import Store

MOST_ACTS = 100_000


def score_history(store: Store, station: str) -> dict[str, Any]:
    """Score of the episodes of a station in a history; see `score_acts`."""
    payloads = store.events("maintenance", station, -LONGEST_NS, LONGEST_NS, MOST_ACTS)
    records = {record.id: record for record in map(MaintenanceRecord.decode, payloads)}
    return score_acts(list(records.values()), episodes_between(store, station, -LONGEST_NS, LONGEST_NS))


def score_acts(records: Sequence[MaintenanceRecord], episodes: Sequence[Episode]) -> dict[str, Any]:
    """How far episodes agree with what crews found.

    An act counts if somebody looked (`found` is not empty). It found a fault unless that is "nothing". The asset was
    told if an episode of it stood when the act was done, at stage `plan` or `act`: to `watch` no crew is sent.

    Returns
    -------
    score : dict
        Counts: `hits` (told, and found), `false_calls` (told, nothing found), `missed` (found, not told), `quiet`
        (neither); `precision` and `recall`, None where there is nothing to divide by; `results`, what the detector
        saw of the acts; `acts`, each of them.
    """
    counts = dict.fromkeys(("hits", "false_calls", "missed", "quiet"), 0)
    acts = []
    for record in sorted(records, key=lambda record: record.time):
        if not record.found.strip():
            continue
        is_found = record.found.strip().lower() != NOTHING
        told = next((one for one in episodes if one.asset == record.asset and _stood(one, record.time)), None)
        is_called = told is not None and told.stage != "watch"
        outcome = ("hits" if is_found else "false_calls") if is_called else ("missed" if is_found else "quiet")
        counts[outcome] += 1
        acts.append(
            {
                "time": to_iso(record.time),
                "asset": record.asset,
                "act": record.act,
                "found": record.found,
                "told": "" if told is None else told.stage,
                "outcome": outcome,
                "result": record.result,
            }
        )
    results = [record.result for record in records]
    return {
        **counts,
        "precision": _share(counts["hits"], counts["hits"] + counts["false_calls"]),
        "recall": _share(counts["hits"], counts["hits"] + counts["missed"]),
        "results": {result: results.count(result) for result in sorted(set(results))},
        "acts": acts,
    }


def _stood(episode: Episode, time_ns: int) -> bool:
    return episode.since <= time_ns and (episode.to is None or time_ns <= episode.to)


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None
