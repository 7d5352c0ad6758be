"""All alarms of a site: their conditions, the acts on them, and what has changed. Pure; clocks are arguments."""

from collections import OrderedDict
from collections.abc import Mapping

from pydantic import BaseModel, ConfigDict, Field

from wetwell.protocols.messages.alarm import Alarm, AlarmAct, AlarmAnswer, RuleName
from wetwell.services.alarms.rates import AlarmRates
from wetwell.services.alarms.record import AlarmRecord
from wetwell.services.alarms.rules import RULES, Rule, alarm_id, parse_alarm_id
from wetwell.services.alarms.status import ActRefusedError, AlarmStatus, back, is_shelf_over, with_act

ANSWERS = 200
"""Acts that are remembered with their answers, so that one that is asked again is not carried out twice."""
STALE_NS = 24 * 3600 * 1_000_000_000
SHELF = "end of shelf"
"""Who takes an alarm from the shelf when its time is over."""


class RegistryState(BaseModel):
    """What is kept of a registry over a restart; on disk a record is called an entry."""

    model_config = ConfigDict(extra="forbid", serialize_by_alias=True)

    records: list[AlarmRecord] = Field(default_factory=list, alias="entries")
    answers: list[AlarmAnswer] = Field(default_factory=list)
    calls_ns: list[int] = Field(default_factory=list)
    is_flood: bool = False


class AlarmRegistry:
    """Alarms by station and name. Each change is also put into `changed`, which who publishes it empties."""

    def __init__(self, rules: Mapping[RuleName, Rule] | None = None) -> None:
        self.rules = RULES if rules is None else rules
        self.changed: list[Alarm] = []
        self.records: dict[tuple[str, str], AlarmRecord] = {}
        self.rates = AlarmRates()
        self._answers: OrderedDict[str, AlarmAnswer] = OrderedDict()
        self._pending: set[tuple[str, str]] = set()

    def observe(
        self,
        station: str,
        rule: RuleName,
        wanted: bool,
        time_ns: int,
        now_ns: int,
        *,
        pump: int | None = None,
        text: str = "",
        advice: str = "",
    ) -> None:
        """Say whether a condition is there.

        Parameters
        ----------
        station, rule, pump
            Which alarm.
        wanted : bool
            Whether its condition is there, before delays.
        time_ns, now_ns : int
            Time of the station; time of day.
        text, advice : str
            For the operator; those of the rule where empty.
        """
        table = self.rules[rule]
        if not table.is_enabled:
            return
        name = (station, alarm_id(rule, pump))
        record = self.records.get(name)
        if record is None:
            if not wanted:
                return
            record = self.records[name] = AlarmRecord(station=station, rule=rule, pump=pump)
        if wanted and not record.delay.is_active:
            record.text, record.advice = text, advice
        if record.observe(wanted, time_ns, table):
            self._tell(record, now_ns, is_call=record.status.state == "unacknowledged")
        if record.delay.held_s is None:
            self._pending.discard(name)
        else:
            self._pending.add(name)

    def carry_on(self, station: str, time_ns: int, now_ns: int) -> None:
        """Let the time of a station pass for the conditions that wait for their delay."""
        if not self._pending:
            return
        for name in [name for name in self._pending if name[0] == station]:
            record = self.records[name]
            wanted = not record.delay.is_active
            words = {"text": record.text, "advice": record.advice}
            self.observe(station, record.rule, wanted, time_ns, now_ns, pump=record.pump, **words)

    def is_known(self, station: str, rule: RuleName) -> bool:
        """Whether there ever was such an alarm of a station."""
        return (station, rule) in self.records

    def is_wanted(self, station: str, rule: RuleName, pump: int | None = None) -> bool:
        """Whether the condition of an alarm counts as there; for deadbands."""
        record = self.records.get((station, alarm_id(rule, pump)))
        return record is not None and record.delay.is_active

    def answered(self, act: AlarmAct) -> AlarmAnswer | None:
        """The answer that an act with this id got before."""
        return self._answers.get(act.id)

    def after(self, act: AlarmAct, now_ns: int) -> tuple[AlarmRecord, AlarmStatus]:
        """The alarm that an act is for and how it would stand after it; nothing is changed.

        Raises
        ------
        ActRefusedError
            If there is no such alarm, or its state does not allow the act.
        """
        record = self.records.get((act.station, act.alarm))
        if record is None:
            try:
                rule, pump = parse_alarm_id(act.alarm)
            except ValueError as error:
                raise ActRefusedError(str(error)) from error
            record = AlarmRecord(station=act.station, rule=rule, pump=pump)
        return record, with_act(record.status, act, now_ns)

    def carry_out(
        self, act: AlarmAct, record: AlarmRecord, status: AlarmStatus, time_ns: int, now_ns: int
    ) -> AlarmAnswer:
        """Let an alarm stand as `after` has said, and answer the act."""
        is_call = status.state == "unacknowledged"
        self.records[record.station, record.id] = record
        record.status = status
        record.touch(time_ns)
        alarm = self._tell(record, now_ns, is_call=is_call)
        return self.remember(AlarmAnswer(id=act.id, is_done=True, alarm=alarm))

    def remember(self, answer: AlarmAnswer) -> AlarmAnswer:
        """Keep an answer, for an act that is asked again."""
        self._answers[answer.id] = answer
        if len(self._answers) > ANSWERS:
            self._answers.popitem(last=False)
        return answer

    def ended_shelves(self, now_ns: int) -> list[tuple[AlarmRecord, AlarmStatus]]:
        """Alarms whose shelf has ended, and how they stand then."""
        over = [record for record in self.records.values() if is_shelf_over(record.status, now_ns)]
        return [(record, back(record.status, SHELF)) for record in over]

    def unshelve(self, record: AlarmRecord, status: AlarmStatus, time_ns: int, now_ns: int) -> None:
        """Let an alarm come from its shelf."""
        record.status = status
        record.touch(time_ns)
        self._tell(record, now_ns, is_call=status.state == "unacknowledged")

    def alarms(self) -> list[Alarm]:
        """All alarms that there ever were."""
        return [record.message(self.rules[record.rule]) for record in self.records.values()]

    def stale(self, time_ns: Mapping[str, int]) -> list[AlarmRecord]:
        """Alarms that stand for more than a day of their station's time."""
        return [
            record
            for record in self.records.values()
            if record.status.is_active
            and record.status.raised_ns is not None
            and time_ns.get(record.station, record.time_ns) - record.status.raised_ns > STALE_NS
        ]

    def chattering(self, time_ns: Mapping[str, int], transitions: int) -> list[tuple[AlarmRecord, int]]:
        """Alarms whose condition came and went more often than this within the last hour, and how often."""
        counts = (
            (record, record.changes_within_hour(time_ns.get(record.station, record.time_ns)))
            for record in self.records.values()
        )
        return sorted(((record, count) for record, count in counts if count > transitions), key=lambda pair: -pair[1])

    def state(self) -> RegistryState:
        """What is to be kept."""
        return RegistryState(
            entries=list(self.records.values()),
            answers=list(self._answers.values()),
            calls_ns=self.rates.calls_ns,
            is_flood=self.rates.is_flood,
        )

    def restore(self, state: RegistryState) -> None:
        """Go on from what was kept."""
        self.records = {(record.station, record.id): record for record in state.records}
        self._pending = {name for name, record in self.records.items() if record.delay.held_s is not None}
        self._answers = OrderedDict((answer.id, answer) for answer in state.answers)
        self.rates = AlarmRates(state.calls_ns, is_flood=state.is_flood)

    def _tell(self, record: AlarmRecord, now_ns: int, *, is_call: bool) -> Alarm:
        if is_call:
            self.rates.add(now_ns)
        alarm = record.message(self.rules[record.rule])
        self.changed.append(alarm)
        return alarm
