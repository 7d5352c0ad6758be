"""What holds for every register and every value."""

import math

from hypothesis import given
from hypothesis import strategies as st

from wetwell.protocols.modbus.registers import decode, encode, register_table

ROWS = register_table(3, 3)
WORD_ORDERS = st.sampled_from(["ABCD", "CDAB"])
MAXIMA = {"uint16": 0xFFFF, "uint32": 0xFFFF_FFFF, "bit": 1}


def rows(*types: str):
    return st.sampled_from([row for row in ROWS if row.type in types])


@given(rows("float32"), st.floats(width=32, allow_nan=False, allow_infinity=False), WORD_ORDERS)
def test_float_round_trip(row, value, word_order):
    words = encode(row, value, word_order)
    assert len(words) == row.count
    assert decode(row, words, word_order) == value


@given(rows("uint16", "uint32", "bit"), st.data(), WORD_ORDERS)
def test_whole_number_round_trip(row, data, word_order):
    value = data.draw(st.integers(0, MAXIMA[row.type]))
    words = encode(row, value, word_order)
    assert len(words) == row.count
    assert all(0 <= word <= 0xFFFF for word in words)
    assert decode(row, words, word_order) == value


@given(st.sampled_from(ROWS), st.sampled_from([None, math.nan, math.inf]), WORD_ORDERS)
def test_no_value_round_trip(row, missing, word_order):
    decoded = decode(row, encode(row, missing, word_order), word_order)
    assert decoded is None if row.type == "float32" else decoded == 0


@given(rows("float32", "uint32"), st.floats(0, 1e6), st.booleans())
def test_word_orders_are_each_others_reverse(row, value, is_missing):
    number = None if is_missing else math.floor(value)
    assert encode(row, number, "ABCD") == encode(row, number, "CDAB")[::-1]


@given(rows("float32"), st.tuples(*[st.integers(0, 0xFFFF)] * 2), WORD_ORDERS)
def test_whatever_a_client_writes_is_a_finite_number_or_none(row, words, word_order):
    value = decode(row, words, word_order)
    assert value is None or math.isfinite(value)
