"""Acts of maintenance on one station: entered once, and checked by the runs that follow."""

from collections import Counter, OrderedDict
from collections.abc import Callable, Iterable

from wetwell.detector.detector import Detector
from wetwell.detector.verdict.act_check import CHECK_RUNS, change_of, is_anew
from wetwell.protocols.messages.maintenance import MaintenanceAct, MaintenanceRecord, Result
from wetwell.protocols.messages.verdict import Verdict

ACTS = 100
"""Acts that are remembered, so that one that is entered again is in the log once."""


class MaintenanceLog:
    """The last acts on the assets of a station.

    Parameters
    ----------
    station : str
    detector : Detector
        Its severities before and after an act are compared.
    publish : callable
        Hears each record when it is new or has changed.
    records : iterable of MaintenanceRecord
        Those of before a restart.
    """

    def __init__(
        self,
        station: str,
        detector: Detector,
        publish: Callable[[MaintenanceRecord], None],
        records: Iterable[MaintenanceRecord] = (),
    ) -> None:
        self._station = station
        self._detector = detector
        self._publish = publish
        self.records = OrderedDict((record.id, record) for record in records)
        self._runs: Counter[str] = Counter()
        self._standing: set[str] = set()

    def enter(self, act: MaintenanceAct) -> list[Verdict]:
        """Enter an act, once; verdicts where pumps are learnt anew by it."""
        if act.id in self.records:
            self._publish(self.records[act.id])  # the record was lost
            return []
        pumps = self._detector.pumps_of(act.asset)
        seen_ns = self._detector.seen_until_ns
        time_ns = seen_ns if act.time is None else act.time
        record = MaintenanceRecord(
            time=time_ns,
            before=self._detector.severity(act.asset),
            **act.model_dump(exclude={"schema_name", "time"}),
        )
        if not pumps:
            reason = f"asset: got '{act.asset}', station '{self._station}' has none of that name"
            self._publish(record.model_copy(update={"result": "refused", "refused": reason}))
            return []
        verdicts: list[Verdict] = []
        if is_anew(act.asset, act.act):
            verdicts = [self._detector.rebaseline(pump, seen_ns) for pump in pumps]
            record = record.model_copy(update={"result": "learning anew"})
        self._keep(record)
        return verdicts

    def follow(self, verdict: Verdict) -> None:
        """Take a verdict into account: after `CHECK_RUNS` runs of the asset an act is judged."""
        assets = {fault.asset for fault in verdict.standing() or ()}
        stood = set(self._standing)
        self._standing = {asset for asset in self._standing if not verdict.speaks_of(asset)} | assets
        if "shift_m" not in verdict.evidence or "early" in verdict.evidence:
            return
        for record in [one for one in self.records.values() if one.result == "pending"]:
            if verdict.window[0] >= record.time and verdict.speaks_of(record.asset):
                self._runs[record.id] += 1
                if self._runs[record.id] >= CHECK_RUNS:
                    self._keep(self._checked(record, is_standing=record.asset in stood & self._standing))

    def _checked(self, record: MaintenanceRecord, *, is_standing: bool) -> MaintenanceRecord:
        after = self._detector.severity(record.asset)
        result: Result = "no change" if is_standing else "back"
        if record.before is not None and after is not None:
            result = change_of(record.before, after)
        return record.model_copy(update={"result": result, "after": after})

    def _keep(self, record: MaintenanceRecord) -> None:
        self.records[record.id] = record
        if len(self.records) > ACTS:
            self.records.popitem(last=False)
        self._publish(record)
