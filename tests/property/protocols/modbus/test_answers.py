"""Whatever a PLC sends: the answer to the question, a refusal, or an error that says it is none. Nothing else.

The environment variable `WETWELL_FUZZ_EXAMPLES` sets the number of examples; for many, run pytest with `--timeout=0`.
"""

import math
import os
import struct
from itertools import chain

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from wetwell.protocols.modbus.block_reads import halves, plan_blocks
from wetwell.protocols.modbus.client import (
    HEAD_BYTES,
    Question,
    RefusedError,
    WrongAnswerError,
    bytes_to_come,
    words_of,
)
from wetwell.protocols.modbus.device_signal import Signal

EXAMPLES = int(os.environ.get("WETWELL_FUZZ_EXAMPLES", "500"))
FUNCTIONS = {"coil": 1, "discrete": 2, "holding": 3, "input": 4}

questions = st.builds(
    Question,
    transaction_id=st.integers(1, 0xFFFF),
    unit_id=st.integers(0, 255),
    table=st.sampled_from(sorted(FUNCTIONS)),
    address=st.integers(0, 0xFF00),
    count=st.integers(1, 125),
)


def size_of(question):
    return -(-question.count // 8) if question.table in {"coil", "discrete"} else 2 * question.count


@st.composite
def answers(draw):
    """A question, and its answer with some of its bytes changed, cut off or added."""
    question = draw(questions)
    size = size_of(question)
    body = bytes([FUNCTIONS[question.table], size]) + draw(st.binary(min_size=size, max_size=size))
    if draw(st.booleans()):
        body = bytes([FUNCTIONS[question.table] | 0x80, draw(st.integers(0, 255))])
    frame = bytearray(struct.pack(">HHHB", question.transaction_id, 0, len(body) + 1, question.unit_id) + body)
    for _ in range(draw(st.integers(0, 3))):
        frame[draw(st.integers(0, len(frame) - 1))] = draw(st.integers(0, 255))
    frame = frame[: draw(st.integers(0, len(frame)))] if draw(st.integers(0, 9)) == 0 else frame
    return question, bytes(frame) + draw(st.binary(max_size=4))


def read(question, frame):
    """Words of a frame as the connection reads it; None where it would wait for more."""
    if len(frame) < HEAD_BYTES:
        return None
    end = HEAD_BYTES + bytes_to_come(question, frame[:HEAD_BYTES])
    return words_of(question, frame[HEAD_BYTES:end]) if len(frame) >= end else None


def check(question, frame):
    try:
        words = read(question, frame)
    except RefusedError as refusal:
        head = struct.pack(">HHHB", question.transaction_id, 0, 3, question.unit_id)
        assert frame.startswith(head + bytes([FUNCTIONS[question.table] | 0x80, refusal.code]))  # noqa: PT017
        return
    except WrongAnswerError:
        return
    if words is None:
        return
    size = size_of(question)
    head = struct.pack(">HHHB", question.transaction_id, 0, size + 3, question.unit_id)
    assert frame[: HEAD_BYTES + 2] == head + bytes([FUNCTIONS[question.table], size])
    data = frame[HEAD_BYTES + 2 : HEAD_BYTES + 2 + size]
    if question.table in {"coil", "discrete"}:
        assert words == [data[n // 8] >> n % 8 & 1 for n in range(question.count)]
    else:
        assert words == list(struct.unpack(f">{question.count}H", data))


@settings(max_examples=EXAMPLES)
@given(answers())
def test_damaged_answers(case):
    check(*case)


@settings(max_examples=EXAMPLES)
@given(questions, st.binary(max_size=300))
@example(Question(1, 1, "input", 0, 1), b"\x00\x01\x00\x00\x00\x03\x01\x84\x0b")
@example(Question(1, 1, "input", 0, 1), b"\x00\x01\x00\x00\x00\x03\x01\x80\x00")
def test_noise(question, frame):
    check(question, frame)


@given(questions, st.binary(max_size=1))
def test_what_is_too_short_for_an_answer(question, pdu):
    with pytest.raises(WrongAnswerError, match=f"{len(pdu)} bytes, must be 2 or more"):
        words_of(question, pdu)


@given(questions)
def test_a_question_is_twelve_bytes_after_the_standard(question):
    head = struct.pack(">HHHB", question.transaction_id, 0, 6, question.unit_id)
    asked = struct.pack(">BHH", FUNCTIONS[question.table], question.address, question.count)
    assert question.encode() == head + asked


signals = st.builds(
    Signal,
    table=st.sampled_from(["holding", "input"]),
    address=st.integers(0, 400),
    type=st.sampled_from(["float32", "uint16", "int16", "uint32", "int32"]),
    scale=st.floats(-1e6, 1e6).filter(bool),
    offset=st.floats(-1e6, 1e6),
)


@given(signals, st.tuples(*[st.integers(0, 0xFFFF)] * 2), st.sampled_from(["ABCD", "CDAB", "BADC", "DCBA"]))
def test_any_words_are_a_finite_number_or_none(signal, words, word_order):
    value = signal.value(words[: signal.count], word_order, "m")
    assert value is None or math.isfinite(value)


@given(st.lists(signals, min_size=1, max_size=40), st.integers(0, 124), st.integers(2, 125))
def test_blocks_fetch_every_signal_once_whole_and_within_the_limits(listed, max_gap, max_words):
    named = {f"pump{n}_head_m": signal for n, signal in enumerate(listed, start=1)}
    blocks = plan_blocks(named, max_gap, max_words)
    assert sorted(name for block in blocks for name in block.names) == sorted(named)
    for block in (*blocks, *chain.from_iterable(halves(whole, named) for whole in blocks)):
        assert 1 <= block.count <= max_words
        for name in block.names:
            signal = named[name]
            assert signal.table == block.table
            words = block.words_of(signal, list(range(block.address, block.address + block.count)))
            assert words == list(range(signal.address, signal.address + signal.count))
