"""Anybody may publish on the bus: no payload brings a daemon down, or keeps it from taking the next good one.

The environment variable `WETWELL_FUZZ_EXAMPLES` sets the number of examples; for many, run pytest with `--timeout=0`.
"""

import contextlib
import json
import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from memory_bus import MemoryBus

from wetwell.protocols.bus.keys import alarm_act_key
from wetwell.protocols.messages.alarm import AlarmAct
from wetwell.protocols.messages.history import HistoryQuery
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.order import Order, Plan
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.alarms.service import AlarmService
from wetwell.services.alarms.station_clock import Now
from wetwell.services.detector.station_detector import StationDetector
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.runtime.settings import AlarmSettings

EXAMPLES = int(os.environ.get("WETWELL_FUZZ_EXAMPLES", "500"))

STAMP = "2025-01-01T00:00:00Z"
SAMPLE = Sample(station="alpha", seq=0, time=0, level_m=1.0, pumps=(PumpReading(flow_m3h=1.0, running=True),) * 3)
VALID = [
    SAMPLE.encode(),
    SampleBlock.of([SAMPLE, SAMPLE.model_copy(update={"seq": 1, "time": 10**9})]).encode(),
    Verdict.model_validate(
        {"station": "alpha", "time": STAMP, "pump": 1, "state": "normal", "probability": {}, "evidence": {}}
        | {"window": [STAMP, STAMP]}
    ).encode(),
    Order.model_validate(
        {"id": "1", "time": STAMP, "station": "alpha", "pump": 1, "act": "rebaseline", "by": "x"}
    ).encode(),
    AlarmAct(id="1", station="alpha", alarm="pump1.pump_fault", act="acknowledge", by="x").encode(),
    HistoryQuery(kind="samples").encode(),
]

SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**70), 2**70),
    st.floats(),
    st.text(max_size=8),
    st.sampled_from([STAMP, "9999-12-31T23:59:59Z", "alpha", "_site", "*", "a/b", "", "NaN", "1e999"]),
)
JSON = st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner))


@st.composite
def changed(draw: st.DrawFn) -> bytes:
    """A valid message with one value replaced, taken out or added."""
    message = json.loads(draw(st.sampled_from(VALID)))
    key = draw(st.sampled_from([*message, "unknown"]))
    if draw(st.booleans()):
        message.pop(key, None)
    else:
        message[key] = draw(JSON)
    return json.dumps(message).encode()


@st.composite
def damaged(draw: st.DrawFn) -> bytes:
    """A valid message with some bytes changed, cut off or inserted."""
    payload = bytearray(draw(st.sampled_from(VALID)))
    at = draw(st.integers(0, len(payload)))
    payload[at : at + draw(st.integers(0, 9))] = draw(st.binary(max_size=9))
    return bytes(payload)


PAYLOADS = st.one_of(changed(), damaged(), st.binary(max_size=40), JSON.map(lambda value: json.dumps(value).encode()))


class Asked:
    """A question that notes its answer."""

    def __init__(self, key: str, payload: bytes) -> None:
        self.key, self.payload, self.answer = key, payload, b""

    def reply(self, payload: bytes) -> None:
        self.answer = payload


@pytest.fixture(scope="module")
def daemons(alpha, tmp_path_factory):
    """Detector, alarms and historian that live through all examples."""
    store = FolderStore(tmp_path_factory.mktemp("history"), keep_live_days=1)
    with MemoryBus() as bus:
        judge = StationDetector(bus, alpha)
        service = AlarmService(bus, AlarmSettings(), [alpha], lambda: Now(0, 0.0))
        yield judge, service, Historian(store)
    store.close()


@settings(max_examples=EXAMPLES)
@given(payload=PAYLOADS)
def test_no_payload_brings_a_daemon_down(daemons, payload):
    judge, service, historian = daemons
    judge.handle_payloads([payload])
    judge.handle_payloads([payload], SampleBlock)
    judge.handle_order(payload)
    for take in (service.handle_sample, service.handle_sample_block, service.handle_verdict, service.handle_status):
        take(payload)
    for kind in ("samples", "verdicts", "alarms"):
        historian.handle(kind, payload)
    act = Asked(alarm_act_key("alpha"), payload)
    service.handle_act(act)
    assert json.loads(act.answer)["schema"] == "wetwell.alarm-answer/1"
    assert json.loads(historian.answer("alpha", payload))["schema"] == "wetwell.history/1"
    with contextlib.suppress(MessageError):
        Plan.decode(payload)
    assert judge.figures().get("failures", 0.0) == 0.0


def test_after_all_of_them_good_samples_are_still_taken(daemons):
    judge, service, historian = daemons
    before = judge.figures().get("samples", 0.0)
    judge.handle_payloads([VALID[0]])
    service.handle_sample(VALID[0])
    historian.handle("samples", VALID[0])
    assert judge.figures()["samples"] == before + 1.0
    assert historian.commit(0) > 0
