"""Verdicts gathered to episodes: one fault of one asset, from its beginning to its end."""

from collections.abc import Iterable

from wetwell.detector.verdict.stage import STAGES
from wetwell.protocols.messages.history import Episode
from wetwell.protocols.messages.verdict import AssetFault, Severity, State, Verdict

NEWS_SHARE = 0.1
"""Of the limit, by which a severity must have grown to be news."""
_STATES: dict[str, State] = {"pump": "pump_fault", "main": "system_fault", "sensor": "sensor_fault"}


class EpisodeLog:
    """Episodes of one station, from its verdicts in order of time.

    Parameters
    ----------
    standing : iterable of Episode
        Those that stand already.
    seen_ns : int
        Verdicts up to this time are known.

    Attributes
    ----------
    standing : dict
        Episodes that stand, by asset.
    """

    def __init__(self, standing: Iterable[Episode] = (), seen_ns: int | None = None) -> None:
        self.standing = {episode.asset: episode for episode in standing}
        self._seen_ns = seen_ns

    def add(self, verdict: Verdict) -> list[Episode]:
        """Episodes that a verdict begins, ends or changes in stage or size; nothing by one that came before."""
        faults = verdict.standing()
        if faults is None or (self._seen_ns is not None and verdict.time < self._seen_ns):
            return []
        self._seen_ns = verdict.time
        news = [episode for fault in faults if (episode := self._told(verdict, fault)) is not None]
        assets = {fault.asset for fault in faults}
        for asset in [asset for asset in self.standing if asset not in assets and verdict.speaks_of(asset)]:
            ended = self.standing.pop(asset).model_copy(update={"time": verdict.time, "to": verdict.time})
            news.append(ended)
        return news

    def _told(self, verdict: Verdict, fault: AssetFault) -> Episode | None:
        """The episode of a fault, if that is news."""
        before = self.standing.get(fault.asset)
        cost = _waiting(verdict)
        if before is None:
            before = Episode(
                time=verdict.time,
                station=verdict.station,
                asset=fault.asset,
                state=_STATES.get(fault.asset.partition(":")[0], "unknown"),
                stage=fault.stage,
                since=min(fault.since, verdict.time),
                severity=fault.severity,
                trend=fault.trend,
                advice=fault.advice,
                cost=cost,
            )
            self.standing[fault.asset] = before
            return before
        is_worse = _size(fault.severity) > _size(before.severity)
        worst = {"severity": fault.severity, "cost": cost} if is_worse else {}
        stage = max(before.stage, fault.stage, key=STAGES.index)
        after = before.model_copy(update={"time": verdict.time, "stage": stage, "trend": fault.trend, **worst})
        is_news = stage != before.stage or _size(fault.severity) >= _size(before.severity) + NEWS_SHARE
        if is_news or not is_worse:  # what is worse by less waits, so that it adds up to news
            self.standing[fault.asset] = after
        return after if is_news else None


def episodes_of(verdicts: Iterable[Verdict]) -> list[Episode]:
    """All episodes in verdicts in order of time, the first to begin first."""
    log, found = EpisodeLog(), {}
    for verdict in verdicts:
        for episode in log.add(verdict):
            found[episode.asset, episode.since] = episode
    for episode in log.standing.values():
        found[episode.asset, episode.since] = episode
    return sorted(found.values(), key=lambda episode: episode.since)


def _size(severity: Severity | None) -> float:
    """Size of a fault as a share of its limit."""
    return 0.0 if severity is None else abs(severity.value) / severity.limit


def _waiting(verdict: Verdict) -> float | None:
    """What it is expected to cost to wait, where the verdict says it."""
    try:
        return float(verdict.evidence["cost"]["expected"]["wait"])
    except (KeyError, TypeError, ValueError):
        return None
