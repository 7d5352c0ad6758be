"""All alarms of a site: their conditions, the acts on them, and what has changed. Pure; clocks are arguments."""

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import replace

from pydantic import BaseModel, ConfigDict, Field

from wetwell.protocols.messages.alarm import STATION, Alarm, AlarmAct, AlarmAnswer, Mode, RuleName
from wetwell.protocols.messages.verdict import AssetFault
from wetwell.services.alarms.rates import AlarmRates
from wetwell.services.alarms.record import AlarmRecord
from wetwell.services.alarms.rules import BY_DESIGN, RULES, Rule, alarm_id, parse_alarm_id
from wetwell.services.alarms.status import (
    SUPPRESSED,
    ActRefusedError,
    AlarmStatus,
    back,
    by_design,
    is_shelf_over,
    with_act,
)

ANSWERS = 200
"""Acts that are remembered with their answers, so that one that is asked again is not carried out twice."""
STALE_NS = 24 * 3600 * 1_000_000_000
SHELF = "end of shelf"
"""Who takes an alarm from the shelf when its time is over."""


_MODE_WORDS: Mapping[Mode | None, str] = {"maintenance": "under maintenance", "stopped": "stopped"}


class RegistryState(BaseModel):
    """What is kept of a registry over a restart; on disk a record is called an entry."""

    model_config = ConfigDict(extra="forbid", serialize_by_alias=True)

    records: list[AlarmRecord] = Field(default_factory=list, alias="entries")
    answers: list[AlarmAnswer] = Field(default_factory=list)
    calls_ns: list[int] = Field(default_factory=list)
    is_flood: bool = False
    modes: dict[str, Mode] = Field(default_factory=dict)
    told_modes: dict[str, Alarm] = Field(default_factory=dict)


class AlarmRegistry:
    """Alarms by station and name. Each change is also put into `changed`, which who publishes it empties."""

    def __init__(self, rules: Mapping[RuleName, Rule] | None = None) -> None:
        self.rules = RULES if rules is None else rules
        self.changed: list[Alarm] = []
        self.records: dict[tuple[str, str], AlarmRecord] = {}
        self.modes: dict[str, Mode] = {}
        self._told_modes: dict[str, Alarm] = {}
        self.rates = AlarmRates()
        self._names: dict[str, set[str]] = {}
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
        asset: str | None = None,
        fault: AssetFault | None = None,
        text: str = "",
        advice: str = "",
    ) -> None:
        """Say whether a condition is there.

        Parameters
        ----------
        station, rule, pump, asset
            Which alarm.
        fault : AssetFault or None
            What is known of the fault, where it is one.
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
        name = (station, alarm_id(rule, pump, asset))
        record = self.records.get(name)
        if record is None:
            if not wanted:
                return
            record = self._add(AlarmRecord(station=station, rule=rule, pump=pump, asset=asset))
        mode = self.modes.get(station)
        if mode is not None and rule in BY_DESIGN[mode]:
            record.status = by_design(record.status)
        if wanted and record.delay.is_active:
            before = record.status
            if record.follow(fault, time_ns, table):
                record.text, record.advice = text, advice
                self._tell(record, now_ns, is_call=record.status.state == "unacknowledged" != before.state)
        elif wanted:
            record.text, record.advice, record.fault = text, advice, fault
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
            self.observe(
                station,
                record.rule,
                wanted,
                time_ns,
                now_ns,
                pump=record.pump,
                asset=record.asset,
                fault=record.fault,
                text=record.text,
                advice=record.advice,
            )

    def of_station(self, station: str) -> list[AlarmRecord]:
        """All alarms of a station that there ever were."""
        return [self.records[station, name] for name in sorted(self._names.get(station, ()))]

    def set_mode(self, station: str, mode: Mode | None, by: str, reason: str, time_ns: int, now_ns: int) -> None:
        """Put a station under maintenance, stop it, or neither: what that suppresses calls nobody until it ends.

        That it is so is told like an alarm, named "station": else nobody would see why there are none.
        """
        if mode is None:
            self.modes.pop(station, None)
        else:
            self.modes[station] = mode
        alarm = Alarm(
            id=STATION,
            time=time_ns,
            station=station,
            priority="advisory",
            state="normal" if mode is None else "suppressed",
            is_active=mode is not None,
            text=_MODE_WORDS.get(mode, "back in operation"),
            raised=None if mode is None else time_ns,
            by=by,
            reason=reason,
        )
        self._told_modes[station] = alarm
        self.changed.append(alarm)
        for record in self.of_station(station):
            is_covered = mode is not None and record.rule in BY_DESIGN[mode]
            if is_covered and record.status.state not in SUPPRESSED:
                record.status = replace(by_design(record.status), by=by, reason=reason)
            elif not is_covered and record.status.state == "suppressed":
                record.status = self._back(record, by, reason)
            else:
                continue
            record.touch(time_ns)
            self._tell(record, now_ns, is_call=record.status.state == "unacknowledged")

    def _back(self, record: AlarmRecord, by: str, reason: str = "") -> AlarmStatus:
        """Status after a suppression; an advisory calls nobody then either."""
        status = back(record.status, by, reason)
        is_advisory = record.priority(self.rules[record.rule]) == "advisory"
        return replace(status, state="acknowledged") if is_advisory and status.is_active else status

    def _add(self, record: AlarmRecord) -> AlarmRecord:
        self.records[record.station, record.id] = record
        self._names.setdefault(record.station, set()).add(record.id)
        return record

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

    def after(self, act: AlarmAct, now_ns: int, time_ns: int) -> tuple[AlarmRecord, AlarmStatus]:
        """The alarm that an act is for and how it would stand after it; nothing is changed.

        Raises
        ------
        ActRefusedError
            If there is no such alarm, or its state does not allow the act.
        """
        record = self.records.get((act.station, act.alarm))
        if record is None:
            try:
                rule, pump, asset = parse_alarm_id(act.alarm)
            except ValueError as error:
                raise ActRefusedError(str(error)) from error
            record = AlarmRecord(station=act.station, rule=rule, pump=pump, asset=asset)
        return record, with_act(record.status, act, now_ns, time_ns)

    def carry_out(
        self, act: AlarmAct, record: AlarmRecord, status: AlarmStatus, time_ns: int, now_ns: int
    ) -> AlarmAnswer:
        """Let an alarm stand as `after` has said, and answer the act."""
        is_call = status.state == "unacknowledged"
        self._add(record)
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
        return [(record, self._back(record, SHELF)) for record in over]

    def unshelve(self, record: AlarmRecord, status: AlarmStatus, time_ns: int, now_ns: int) -> None:
        """Let an alarm come from its shelf."""
        record.status = status
        record.touch(time_ns)
        self._tell(record, now_ns, is_call=status.state == "unacknowledged")

    def alarms(self) -> list[Alarm]:
        """All alarms that there ever were, and the modes of stations."""
        records = [record.message(self.rules[record.rule]) for record in self.records.values()]
        return [*records, *self._told_modes.values()]

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
            modes=self.modes,
            told_modes=self._told_modes,
        )

    def restore(self, state: RegistryState) -> None:
        """Go on from what was kept."""
        self.records, self._names = {}, {}
        for record in state.records:
            self._add(record)
        self.modes, self._told_modes = dict(state.modes), dict(state.told_modes)
        self._pending = {name for name, record in self.records.items() if record.delay.held_s is not None}
        self._answers = OrderedDict((answer.id, answer) for answer in state.answers)
        self.rates = AlarmRates(state.calls_ns, is_flood=state.is_flood)

    def _tell(self, record: AlarmRecord, now_ns: int, *, is_call: bool) -> Alarm:
        if is_call:
            self.rates.add(now_ns)
        alarm = record.message(self.rules[record.rule])
        self.changed.append(alarm)
        return alarm
