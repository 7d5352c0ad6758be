"""One alarm with all that is kept of it."""

from pydantic import BaseModel, ConfigDict, Field

from wetwell.protocols.messages.alarm import Alarm, Priority, RuleName
from wetwell.protocols.messages.verdict import AssetFault
from wetwell.protocols.timestamps import MAX_STAMP_NS, NS_PER_DAY, NS_PER_S
from wetwell.services.alarms.delay import Delay
from wetwell.services.alarms.rules import PRIORITIES, RANK, Rule, alarm_id
from wetwell.services.alarms.status import AlarmStatus, escalated, with_condition

CHANGES = 100
"""Changes of the condition within an hour that are remembered at most."""
HOUR_NS = 3600 * NS_PER_S
NEWS_SHARE = 0.1
"""Of the limit, by which a severity must have moved to be told anew."""


class AlarmRecord(BaseModel):
    """An alarm: how it stands, its delays, its words, and when its condition changed within the last hour.

    `fault` is what was told of it last, where it is one of an asset.

    On disk its status is called standing.
    """

    model_config = ConfigDict(extra="forbid", serialize_by_alias=True)

    station: str
    rule: RuleName
    pump: int | None = None
    asset: str | None = None
    fault: AssetFault | None = None
    status: AlarmStatus = Field(default=AlarmStatus(), alias="standing")
    delay: Delay = Field(default_factory=Delay)
    text: str = ""
    advice: str = ""
    time_ns: int = 0
    changes_ns: list[int] = Field(default_factory=list)

    @property
    def id(self) -> str:
        """Name of the alarm within its station."""
        return alarm_id(self.rule, self.pump, self.asset)

    def observe(self, wanted: bool, time_ns: int, rule: Rule) -> bool:
        """Take a look at the condition; whether the alarm has changed by it."""
        is_active = self.delay.update(wanted, time_ns, rule.on_delay_s, rule.off_delay_s)
        before = self.status
        if is_active == before.is_active:
            return False
        self.status = with_condition(
            before,
            is_active=is_active,
            time_ns=time_ns,
            is_call=self.priority(rule) != "advisory",
            is_latching=rule.is_latching,
        )
        self.changes_ns = [*(at for at in self.changes_ns if 0 <= time_ns - at < HOUR_NS), time_ns][-CHANGES:]
        self.touch(time_ns)
        return True

    def priority(self, rule: Rule) -> Priority:
        """By the stage of the fault, where it is one; at the stage "act" that of the rule."""
        return rule.priority if self.fault is None else PRIORITIES.get(self.fault.stage, rule.priority)

    def follow(self, fault: AssetFault | None, time_ns: int, rule: Rule) -> bool:
        """Take what is told of an alarm that stands; whether that is news: a stage, a tenth of the limit, a day."""
        before, self.fault = self.fault, fault or self.fault
        if fault is None or before is None:
            return fault is not None
        priority = PRIORITIES.get(before.stage, rule.priority)
        if RANK[self.priority(rule)] < RANK[priority]:
            self.status = escalated(self.status)
        is_news = before.stage != fault.stage or time_ns - self.time_ns >= NS_PER_DAY
        if before.severity is not None and fault.severity is not None and not is_news:
            is_news = abs(fault.severity.value - before.severity.value) >= NEWS_SHARE * fault.severity.limit
        if is_news:
            self.touch(time_ns)
        else:
            self.fault = before
        return is_news

    def touch(self, time_ns: int) -> None:
        """Note a change; no two changes of an alarm have the same time, and a later one never has an earlier one."""
        self.time_ns = min(max(time_ns, self.time_ns + 1), MAX_STAMP_NS)

    def changes_within_hour(self, now_ns: int) -> int:
        """How often the condition came or went in the last hour of the station's time."""
        return sum(0 <= now_ns - at < HOUR_NS for at in self.changes_ns)

    def message(self, rule: Rule) -> Alarm:
        """The alarm as others see it."""
        status = self.status
        return Alarm(
            id=self.id,
            time=self.time_ns,
            station=self.station,
            pump=self.pump,
            asset=self.asset,
            stage=None if self.fault is None else self.fault.stage,
            severity=None if self.fault is None else self.fault.severity,
            trend=None if self.fault is None else self.fault.trend,
            priority=self.priority(rule),
            state=status.state,
            is_active=status.is_active,
            text=self.text or rule.text,
            advice=self.advice or rule.advice,
            raised=status.raised_ns,
            returned=status.returned_ns,
            acknowledged=status.acknowledged_ns,
            by=status.by,
            until=status.until_ns,
            reason=status.reason,
        )
