"""Messages as JSON: exactly the fields of the interface, and one kind of error for whatever else arrives."""

import json
import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.status import Status
from wetwell.protocols.messages.verdict import Verdict

TIME_NS, TIME = 1_735_689_600_000_000_000, "2025-01-01T00:00:00Z"
READING = PumpReading(frequency_hz=50.0, flow_m3h=200.0, head_m=26.0, power_kw=18.7, running=True)
SAMPLE = Sample(station="alpha", seq=7, time=TIME_NS, level_m=1.25, inflow_m3h=57.6, pumps=(READING, PumpReading()))
VERDICT = Verdict(
    time=TIME_NS,
    station="alpha",
    pump=1,
    state="pump_fault",
    probability={"pump_fault": 0.75, "normal": 0.25},
    evidence={"log_p": -12.5, "samples": 3, "note": "fell"},
    onset=None,
    window=(TIME_NS, TIME_NS + 1_500_000_000),
)
STATUS = Status(time=TIME_NS, station="alpha", service="gateway", state="running", figures={"drops": 0.0})
MESSAGES = pytest.mark.parametrize("message", [SAMPLE, VERDICT, STATUS], ids=["sample", "verdict", "status"])


def test_sample_is_exactly_that_of_the_interface():
    assert json.loads(SAMPLE.encode()) == {
        "schema": "wetwell.sample/1",
        "station": "alpha",
        "seq": 7,
        "time": TIME,
        "level_m": 1.25,
        "inflow_m3h": 57.6,
        "pumps": [
            {"frequency_hz": 50.0, "flow_m3h": 200.0, "head_m": 26.0, "power_kw": 18.7, "running": True},
            {"frequency_hz": None, "flow_m3h": None, "head_m": None, "power_kw": None, "running": None},
        ],
        "quality": "good",
    }


def test_verdict_is_exactly_that_of_the_interface():
    assert json.loads(VERDICT.encode()) == {
        "schema": "wetwell.verdict/1",
        "time": TIME,
        "station": "alpha",
        "pump": 1,
        "state": "pump_fault",
        "probability": {"pump_fault": 0.75, "normal": 0.25},
        "evidence": {"log_p": -12.5, "samples": 3, "note": "fell"},
        "onset": None,
        "window": [TIME, "2025-01-01T00:00:01.500Z"],
        "asset": None,
        "stage": None,
        "severity": None,
        "trend": None,
        "faults": None,
    }
    late = VERDICT.model_copy(update={"onset": TIME_NS})
    assert json.loads(late.encode())["onset"] == TIME
    assert Verdict.decode(late.encode()).onset == TIME_NS


def test_verdict_states_are_those_of_the_interface():
    states = {
        "learning",
        "normal",
        "pump_fault",
        "system_fault",
        "pump_and_system_fault",
        "sensor_fault",
        "unknown",
    }
    body = json.loads(VERDICT.encode())
    for state in states:
        assert Verdict.decode(json.dumps(body | {"state": state}).encode()).state == state
    with pytest.raises(MessageError, match="state: got 'broken', input should be 'learning'"):
        Verdict.decode(json.dumps(body | {"state": "broken"}).encode())


@MESSAGES
def test_round_trip(message):
    payload = message.encode()
    assert type(message).decode(payload) == message
    assert type(message).decode(payload).encode() == payload
    assert "\n" not in payload.decode("utf-8")


@MESSAGES
def test_is_frozen(message):
    with pytest.raises(ValidationError, match="frozen"):
        message.station = "beta"


@MESSAGES
def test_unknown_keys_of_newer_senders_are_ignored(message):
    body = json.loads(message.encode())
    newer = body | {"colour": "blue", "nested": {"a": [1]}}
    assert type(message).decode(json.dumps(newer).encode()) == message
    if "pumps" in body:
        body["pumps"][0]["vibration_mm_s"] = 3.0
        assert type(message).decode(json.dumps(body).encode()) == message


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_no_value_is_null_in_json(value):
    sample = SAMPLE.model_copy(
        update={"level_m": value, "inflow_m3h": value, "pumps": (PumpReading(head_m=value, flow_m3h=value),)}
    )
    body = json.loads(sample.encode(), parse_constant=pytest.fail)
    assert body["level_m"] is None
    assert body["inflow_m3h"] is None
    assert body["pumps"][0]["head_m"] is None
    again = Sample.decode(sample.encode())
    assert again.level_m is None
    assert again.pumps[0].flow_m3h is None


def test_evidence_without_a_value_is_null_in_json():
    verdict = VERDICT.model_copy(update={"evidence": {"log_p": -math.inf, "of": [math.nan, 1.0]}})
    body = json.loads(verdict.encode(), parse_constant=pytest.fail)
    assert body["evidence"] == {"log_p": None, "of": [None, 1.0]}
    assert Verdict.decode(verdict.encode()).evidence == {"log_p": None, "of": [None, 1.0]}


def test_measured_values_may_be_absent():
    sample = Sample.decode(b'{"station": "a", "seq": 0, "time": "2025-01-01T00:00:00Z", "pumps": [{}]}')
    assert (sample.level_m, sample.inflow_m3h, sample.quality) == (None, None, "good")
    assert sample.pumps == (PumpReading(),)


@pytest.mark.parametrize("time", [TIME, "2025-01-01T01:00:00+01:00", "2025-01-01 00:00:00", TIME_NS])
def test_times_are_understood(time):
    body = json.loads(SAMPLE.encode()) | {"time": time}
    assert Sample.decode(json.dumps(body).encode()).time == TIME_NS


def without(key):
    body = json.loads(SAMPLE.encode())
    del body[key]
    return body


def having(**changes):
    return json.loads(SAMPLE.encode()) | changes


@pytest.mark.parametrize(
    ("payload", "rule"),
    [
        (b"", "EOF while parsing"),
        (b"{", "EOF while parsing"),
        (b"\xff\xfe", "invalid JSON"),
        (b"[" * 5000, "invalid JSON"),
        (b"null", "input should be an object"),
        (b"[1]", "input should be an object"),
        (without("station"), "station: missing"),
        (without("time"), "time: missing"),
        (without("pumps"), "pumps: missing"),
        (having(schema="wetwell.sample/2"), "schema: got 'wetwell.sample/2', input should be 'wetwell.sample/1'"),
        (having(schema="wetwell.verdict/1"), "schema: got 'wetwell.verdict/1'"),
        (having(seq=-1), "seq: got -1, input should be greater than or equal to 0"),
        (having(seq=1.5), "seq: got 1.5"),
        (having(time="soon\nor later"), r"time: invalid isoformat string: 'soon\nor later'"),
        (having(time="9999-01-01T00:00:00Z"), "time: time must lie in the years 1678 to 2262"),
        (having(time="0001-01-01T00:00:00+14:00"), "time: time must lie in the years 1678 to 2262"),
        (having(time=10**30), "time: got 1"),
        (having(time=-(2**63)), "time: got -9223372036854775808"),
        (having(time=None), "time: got None"),
        (having(level_m="deep"), "level_m: got 'deep', input should be a valid number"),
        (having(quality="fine"), "quality: got 'fine', input should be 'good', 'uncertain' or 'bad'"),
        (having(pumps=3), "pumps: got 3"),
        (having(pumps=[{}, 3]), "pumps[2]: "),
        (having(pumps=[{"running": "perhaps"}]), "pumps[1].running: got 'perhaps'"),
        (having(station=5), "station: got 5"),
    ],
)
def test_malformed_payload_gives_one_line(payload, rule):
    if not isinstance(payload, bytes):
        payload = json.dumps(payload).encode()
    with pytest.raises(MessageError) as caught:
        Sample.decode(payload)
    line = str(caught.value)
    assert line.startswith("sample: ")
    assert line.isprintable()
    assert rule.lower() in line.lower()
    assert caught.value.__cause__ is not None


def test_a_key_over_two_lines_gives_one_line():
    body = json.loads(VERDICT.encode()) | {"probability": {"two\nlines": 1.0}}
    with pytest.raises(MessageError) as caught:
        Verdict.decode(json.dumps(body).encode())
    assert str(caught.value).isprintable()
    assert r"'two\nlines'" in str(caught.value)


JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=12),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)


def decode_or_message_error(kind, payload):
    try:
        message = kind.decode(payload)
    except MessageError as error:
        assert str(error).isprintable()  # noqa: PT017 - a payload may also be a message
    else:
        assert isinstance(message, kind)
        json.loads(message.encode(), parse_constant=pytest.fail)


@settings(max_examples=200)
@given(st.sampled_from([Sample, Verdict, Status]), st.binary(max_size=200))
def test_any_bytes_give_a_message_or_a_message_error(kind, payload):
    decode_or_message_error(kind, payload)


@settings(max_examples=100)
@given(st.data())
def test_any_json_in_any_field_gives_a_message_or_a_message_error(data):
    message = data.draw(st.sampled_from([SAMPLE, VERDICT, STATUS]))
    body = json.loads(message.encode())
    for key in data.draw(st.lists(st.sampled_from(sorted(body)), min_size=1, max_size=2)):
        body[key] = data.draw(JSON_VALUES | st.text().map(lambda text: {text: 1.0}) | st.datetimes().map(str))
    decode_or_message_error(type(message), json.dumps(body).encode())


@settings(max_examples=200)
@given(st.integers(0, 400), st.binary(max_size=4))
@example(0, b"\xef\xbb\xbf{")
def test_a_damaged_message_gives_a_message_or_a_message_error(position, garbage):
    payload = SAMPLE.encode()
    decode_or_message_error(Sample, payload[:position] + garbage + payload[position + len(garbage) :])
