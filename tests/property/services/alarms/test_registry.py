"""Alarms under any order of conditions, acts, shelves and restarts."""

import json

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from wetwell.protocols.messages.alarm import AlarmAct, AlarmAnswer
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.alarms.registry import AlarmRegistry, RegistryState
from wetwell.services.alarms.rules import RULES, changed_rules
from wetwell.services.alarms.status import ActRefusedError

ALARMS = [(station, pump) for station in ("alpha", "beta") for pump in (1, 2)]
NAMES = ("acknowledge", "shelve", "unshelve", "out_of_service", "in_service")
SUPPRESSED = ("shelved", "out_of_service")


class Alarms(RuleBasedStateMachine):
    """A registry that may be killed after any step beside a plain account of what an operator was told."""

    def __init__(self) -> None:
        super().__init__()
        self.now_s = 0
        self.acts = 0
        self.is_there = dict.fromkeys(ALARMS, False)
        self.is_raised = dict.fromkeys(ALARMS, False)
        self.is_seen = dict.fromkeys(ALARMS, False)
        self.times: dict[tuple[str, int], int] = {}
        self.sent: list[tuple[AlarmAct, AlarmAnswer]] = []

    @initialize(on_s=st.sampled_from([0, 3]), off_s=st.sampled_from([0, 2]))
    def begin(self, on_s: int, off_s: int) -> None:
        self.rules = changed_rules({"pump_fault": {"on_delay_s": on_s, "off_delay_s": off_s}})
        self.registry = AlarmRegistry(self.rules)

    @rule(name=st.sampled_from(ALARMS), is_there=st.booleans(), seconds=st.integers(0, 5))
    def see(self, name: tuple[str, int], is_there: bool, seconds: int) -> None:
        self.now_s += seconds
        self.is_there[name] = is_there
        station, pump = name
        now_ns = self.now_s * NS_PER_S
        self.registry.observe(station, "pump_fault", is_there, now_ns, now_ns, pump=pump)
        self.hear(None)

    @rule(name=st.sampled_from(ALARMS), act=st.sampled_from(NAMES), minutes=st.floats(0.02, 0.2))
    def act(self, name: tuple[str, int], act: str, minutes: float) -> None:
        self.acts += 1
        fields = {"id": str(self.acts), "station": name[0], "alarm": f"pump{name[1]}.pump_fault", "by": "ann"}
        self.ask(AlarmAct.model_validate(fields | {"act": act, "minutes": minutes}))

    @rule()
    def ask_again(self) -> None:
        if self.sent:
            act, answer = self.sent[-1]
            assert self.registry.answered(act) == answer

    @rule(seconds=st.integers(1, 15))
    def wait(self, seconds: int) -> None:
        self.now_s += seconds
        now_ns = self.now_s * NS_PER_S
        for record, status in self.registry.ended_shelves(now_ns):
            self.registry.unshelve(record, status, now_ns, now_ns)
        self.hear("unshelve")
        for record in self.registry.records.values():
            until_ns = record.status.until_ns
            assert (until_ns is not None) == (record.status.state == "shelved")
            assert until_ns is None or until_ns > now_ns, "a shelf has ended and nobody was told"

    @rule()
    def restart(self) -> None:
        kept = self.registry.state().model_dump_json()
        self.registry = AlarmRegistry(self.rules)
        self.registry.restore(RegistryState.model_validate_json(kept))
        assert json.loads(self.registry.state().model_dump_json()) == json.loads(kept)
        assert self.registry.changed == []

    def ask(self, act: AlarmAct) -> None:
        now_ns = self.now_s * NS_PER_S
        try:
            record, after = self.registry.after(act, now_ns, now_ns)
        except ActRefusedError:
            return
        answer = self.registry.carry_out(act, record, after, now_ns, now_ns)
        self.sent.append((act, answer))
        self.hear(act.act)

    def hear(self, act: str | None) -> None:
        """Check every message against the account."""
        changed, self.registry.changed = self.registry.changed, []
        for alarm in changed:
            name = (alarm.station, alarm.pump)
            assert alarm.time > self.times.get(name, -1), "two changes at one time"
            self.times[name] = alarm.time
            if act is None:
                assert alarm.is_active != self.is_raised[name], "raised twice, or cleared twice"
                self.is_raised[name] = alarm.is_active
                self.is_seen[name] = False
            assert alarm.is_active == self.is_raised[name], "an act has changed the condition"
            if act == "acknowledge":
                self.is_seen[name] = True
            elif act in ("unshelve", "in_service"):
                self.is_seen[name] = False

    @invariant()
    def states_agree_with_what_was_told(self) -> None:
        for alarm in self.registry.alarms() if hasattr(self, "registry") else ():
            name = (alarm.station, alarm.pump)
            if alarm.state == "unacknowledged":
                assert alarm.is_active
                assert not self.is_seen[name], "an acknowledgement was lost"
            elif alarm.state == "acknowledged":
                assert alarm.is_active
                assert self.is_seen[name], "acknowledged by nobody"
            elif alarm.state not in SUPPRESSED:
                assert not alarm.is_active
            delays = RULES["pump_fault"].on_delay_s == self.rules["pump_fault"].on_delay_s == 0.0
            if delays and self.rules["pump_fault"].off_delay_s == 0.0:
                assert alarm.is_active == self.is_there[name]


Alarms.TestCase.settings = settings(
    max_examples=150, stateful_step_count=40, suppress_health_check=[HealthCheck.too_slow]
)
TestAlarms = Alarms.TestCase
