"""Time stamps to and from ISO 8601."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wetwell.protocols.recordings.stamp_texts import iso_texts
from wetwell.protocols.timestamps import MAX_STAMP_NS, NS_PER_S, from_iso, to_iso

STAMPS = st.integers(-MAX_STAMP_NS, MAX_STAMP_NS)


@given(STAMPS)
def test_round_trip_loses_nothing(stamp_ns):
    assert from_iso(to_iso(stamp_ns)) == stamp_ns


@given(st.lists(STAMPS, max_size=5), st.sampled_from([1, 1_000_000, NS_PER_S]))
def test_array_round_trip(stamps_ns, unit_ns):
    stamps_ns = [stamp_ns // unit_ns // 2 * unit_ns for stamp_ns in stamps_ns]
    texts = iso_texts(np.array(stamps_ns, dtype=np.int64))
    assert [from_iso(text) for text in texts.to_pylist()] == stamps_ns
    assert len({len(text) for text in texts.to_pylist()}) <= 1


@pytest.mark.parametrize(
    ("text", "stamp_ns"),
    [
        ("1970-01-01T00:00:00Z", 0),
        ("1970-01-01 00:00:01", NS_PER_S),
        ("1970-01-02", 86_400 * NS_PER_S),
        ("1970-01-01T01:00:00+01:00", 0),
        ("1969-12-31T23:59:59.5Z", -NS_PER_S // 2),
        ("1970-01-01T00:00:00.25+00:00", NS_PER_S // 4),
        ("1970-01-01T00:00:00,000001Z", 1000),
        ("1970-01-01T00:00:00.000000001Z", 1),
        ("1970-01-01T00:00:00.1234567Z", 123_456_700),
        ("1970-01-01T00:00:00.123456789+00:30", 123_456_789 - 1800 * NS_PER_S),
        ("2025-01-01T00:00:00Z", 1_735_689_600 * NS_PER_S),
    ],
)
def test_known_stamps(text, stamp_ns):
    assert from_iso(text) == stamp_ns


@pytest.mark.parametrize(
    ("stamp_ns", "text"),
    [
        (0, "1970-01-01T00:00:00Z"),
        (1_000_000, "1970-01-01T00:00:00.001Z"),
        (1_000, "1970-01-01T00:00:00.000001000Z"),
        (-1, "1969-12-31T23:59:59.999999999Z"),
    ],
)
def test_as_short_as_it_can_be(stamp_ns, text):
    assert to_iso(stamp_ns) == text


@pytest.mark.parametrize(
    "text", ["", "soon", "2025-13-01", "2025-01-01T25:00:00Z", "9999-01-01T00:00:00Z", "0001-01-01T00:00:00+14:00"]
)
def test_other_texts_are_refused(text):
    with pytest.raises(ValueError, match=r"isoformat|month|hour|years 1678 to 2262"):
        from_iso(text)
