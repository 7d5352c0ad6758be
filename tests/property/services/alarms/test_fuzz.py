"""Whatever somebody sends, the service of alarms goes on and what it publishes can be read."""

import json

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from memory_bus import MemoryBus

from wetwell.protocols.bus.interface import Presence
from wetwell.protocols.bus.keys import alarm_act_key, alarm_key
from wetwell.protocols.messages.alarm import Alarm, AlarmAnswer
from wetwell.services.alarms.service import AlarmService
from wetwell.services.alarms.station_clock import Now
from wetwell.services.runtime.settings import AlarmSettings

SCALARS = st.none() | st.booleans() | st.floats() | st.integers(-(10**400), 10**400) | st.text(max_size=8)
ANYTHING = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3)
)
TIMES = st.sampled_from(["2026-01-01T00:00:00Z", "2262-04-11T23:47:16Z", "1678-01-01T00:00:00Z"])
STATIONS = st.sampled_from(["alpha", "beta", "_site", "../x", ""])
STATES = st.sampled_from(["normal", "pump_fault", "system_fault", "pump_and_system_fault", "sensor_fault", "unknown"])
SEVERITY = st.dictionaries(
    st.sampled_from(["speed_loss_percent", "friction_rise_percent"]),
    st.fixed_dictionaries({"value": ANYTHING, "interval": st.lists(SCALARS, max_size=3) | ANYTHING}) | ANYTHING,
)
MESSAGES = {
    "sample": st.fixed_dictionaries(
        {
            "station": STATIONS,
            "seq": st.integers(0, 2**63 - 1),
            "time": TIMES,
            "level_m": SCALARS,
            "pumps": st.just([]),
        }
    ),
    "verdict": st.fixed_dictionaries(
        {
            "time": TIMES,
            "station": STATIONS,
            "pump": st.integers(1, 40),
            "state": STATES,
            "probability": st.dictionaries(STATES, st.floats(), max_size=2),
            "evidence": st.fixed_dictionaries({"severity": SEVERITY | ANYTHING, "advice": ANYTHING}),
            "window": st.tuples(TIMES, TIMES),
        }
    ),
    "status": st.fixed_dictionaries(
        {
            "time": TIMES,
            "station": STATIONS,
            "service": st.just("gateway"),
            "state": st.sampled_from(["running", "waiting"]),
            "figures": st.dictionaries(st.just("heartbeat_age_s"), st.floats()),
        }
    ),
    "act": st.fixed_dictionaries(
        {
            "id": st.text(max_size=3),
            "station": STATIONS,
            "alarm": st.sampled_from(["pump2.pump_fault", "level_high", "pump2.x"]) | st.text(max_size=3),
            "act": st.sampled_from(["acknowledge", "shelve", "unshelve", "out_of_service", "in_service"]),
            "by": st.text(max_size=3),
            "minutes": SCALARS,
            "reason": st.text(max_size=3),
        }
    ),
}
SENT = st.sampled_from(sorted(MESSAGES)).flatmap(
    lambda kind: st.tuples(
        st.just(kind), MESSAGES[kind].map(lambda fields: json.dumps(fields).encode()) | st.binary()
    )
)


class Question:
    def __init__(self, payload: bytes) -> None:
        self.key = alarm_act_key("alpha")
        self.payload = payload
        self.answer: AlarmAnswer | None = None

    def reply(self, payload: bytes) -> None:
        self.answer = AlarmAnswer.decode(payload)


@settings(max_examples=150, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(SENT, max_size=12))
def test_no_payload_stops_the_service(sent):
    bus, now_s = MemoryBus(), [0.0]
    rules = {name: {"on_delay_s": 0.0} for name in ("level_high", "plc_lost")}
    service = AlarmService(
        bus, AlarmSettings(high_level_m=1.0, rules=rules), (), lambda: Now(round(now_s[0] * 1e9), now_s[0])
    )
    changes = bus.subscribe(alarm_key("*"))
    for kind, payload in sent:
        if kind == "act":
            question = Question(payload)
            service.handle_act(question)
            assert question.answer is not None
        else:
            {"sample": service.handle_sample, "verdict": service.handle_verdict, "status": service.handle_status}[
                kind
            ](payload)
        now_s[0] += 20.0
        service.look()
    service.handle_presence(Presence("wetwell/x//alive/detector", is_alive=True))
    service.report()
    for payload in changes._messages:
        Alarm.decode(payload)
