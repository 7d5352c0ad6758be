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


class BookState(BaseModel):
    """What is kept of a book over a restart."""

    model_config = ConfigDict(extra="forbid")

    entries: list[AlarmRecord] = Field(default_factory=list)
    answers: list[AlarmAnswer] = Field(default_factory=list)
    calls_ns: list[int] = Field(default_factory=list)
    is_flood: bool = False


class AlarmRegistry:
    """Alarms by station and name. Each change is also put into `changed`, which who publishes it empties."""

    def __init__(self, rules: Mapping[RuleName, Rule] | None = None) -> None:
        self.rules = RULES if rules is None else rules
        self.changed: list[Alarm] = []
        self.entries: dict[tuple[str, str], AlarmRecord] = {}
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
        entry = self.entries.get(name)
        if entry is None:
            if not wanted:
                return
            entry = self.entries[name] = AlarmRecord(station=station, rule=rule, pump=pump)
        if wanted and not entry.delay.is_active:
            entry.text, entry.advice = text, advice
        if entry.observe(wanted, time_ns, table):
            self._tell(entry, now_ns, is_call=entry.standing.state == "unacknowledged")
        if entry.delay.held_s is None:
            self._pending.discard(name)
        else:
            self._pending.add(name)

    def carry_on(self, station: str, time_ns: int, now_ns: int) -> None:
        """Let the time of a station pass for the conditions that wait for their delay."""
        for name in [name for name in self._pending if name[0] == station]:
            entry = self.entries[name]
            wanted = not entry.delay.is_active
            words = {"text": entry.text, "advice": entry.advice}
            self.observe(station, entry.rule, wanted, time_ns, now_ns, pump=entry.pump, **words)

    def is_wanted(self, station: str, rule: RuleName, pump: int | None = None) -> bool:
        """Whether the condition of an alarm counts as there; for deadbands."""
        entry = self.entries.get((station, alarm_id(rule, pump)))
        return entry is not None and entry.delay.is_active

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
        entry = self.entries.get((act.station, act.alarm))
        if entry is None:
            try:
                rule, pump = parse_alarm_id(act.alarm)
            except ValueError as error:
                raise ActRefusedError(str(error)) from error
            entry = AlarmRecord(station=act.station, rule=rule, pump=pump)
        return entry, with_act(entry.standing, act, now_ns)

    def carry_out(
        self, act: AlarmAct, entry: AlarmRecord, standing: AlarmStatus, time_ns: int, now_ns: int
    ) -> AlarmAnswer:
        """Let an alarm stand as `after` has said, and answer the act."""
        is_call = standing.state == "unacknowledged"
        self.entries[entry.station, entry.id] = entry
        entry.standing = standing
        entry.touch(time_ns)
        alarm = self._tell(entry, now_ns, is_call=is_call)
        return self.remember(AlarmAnswer(id=act.id, is_done=True, alarm=alarm))

    def remember(self, answer: AlarmAnswer) -> AlarmAnswer:
        """Keep an answer, for an act that is asked again."""
        self._answers[answer.id] = answer
        if len(self._answers) > ANSWERS:
            self._answers.popitem(last=False)
        return answer

    def shelves_over(self, now_ns: int) -> list[tuple[AlarmRecord, AlarmStatus]]:
        """Alarms whose shelf has ended, and how they stand then."""
        over = [entry for entry in self.entries.values() if is_shelf_over(entry.standing, now_ns)]
        return [(entry, back(entry.standing, SHELF)) for entry in over]

    def take_back(self, entry: AlarmRecord, standing: AlarmStatus, time_ns: int, now_ns: int) -> None:
        """Let an alarm come from its shelf."""
        entry.standing = standing
        entry.touch(time_ns)
        self._tell(entry, now_ns, is_call=standing.state == "unacknowledged")

    def alarms(self) -> list[Alarm]:
        """All alarms that there ever were."""
        return [entry.message(self.rules[entry.rule]) for entry in self.entries.values()]

    def stale(self, time_ns: Mapping[str, int]) -> list[AlarmRecord]:
        """Alarms that stand for more than a day of their station's time."""
        return [
            entry
            for entry in self.entries.values()
            if entry.standing.is_active
            and entry.standing.raised_ns is not None
            and time_ns.get(entry.station, entry.time_ns) - entry.standing.raised_ns > STALE_NS
        ]

    def chattering(self, time_ns: Mapping[str, int], transitions: int) -> list[tuple[AlarmRecord, int]]:
        """Alarms whose condition came and went more often than this within the last hour, and how often."""
        counts = (
            (entry, entry.changes_within_hour(time_ns.get(entry.station, entry.time_ns)))
            for entry in self.entries.values()
        )
        return sorted(((entry, count) for entry, count in counts if count > transitions), key=lambda pair: -pair[1])

    def state(self) -> BookState:
        """What is to be kept."""
        return BookState(
            entries=list(self.entries.values()),
            answers=list(self._answers.values()),
            calls_ns=self.rates.calls_ns,
            is_flood=self.rates.is_flood,
        )

    def restore(self, state: BookState) -> None:
        """Go on from what was kept."""
        self.entries = {(entry.station, entry.id): entry for entry in state.entries}
        self._pending = {name for name, entry in self.entries.items() if entry.delay.held_s is not None}
        self._answers = OrderedDict((answer.id, answer) for answer in state.answers)
        self.rates = AlarmRates(state.calls_ns, is_flood=state.is_flood)

    def _tell(self, entry: AlarmRecord, now_ns: int, *, is_call: bool) -> Alarm:
        if is_call:
            self.rates.add(now_ns)
        alarm = entry.message(self.rules[entry.rule])
        self.changed.append(alarm)
        return alarm
