"""Spans follow one another without a gap; refused ones grow, and are passed over in the end."""

from hypothesis import given
from hypothesis import strategies as st

from wetwell.protocols.timestamps import NS_PER_DAY
from wetwell.services.stations import find_station
from wetwell.sim2real.watch.spans import LONGEST_DAYS, MOST_ROWS, looked_over, refused, span_due
from wetwell.sim2real.watch.state import WatchState

NEW = WatchState(station=find_station("alpha"))


def test_a_span_is_due_when_its_day_is_over():
    assert span_due(NEW, 7, 7 + NS_PER_DAY - 1) is None
    assert span_due(NEW, 7, 7 + NS_PER_DAY) == (7, 7 + NS_PER_DAY)


@given(refusals=st.lists(st.booleans(), max_size=40), rows=st.integers(1, MOST_ROWS - 1))
def test_spans_follow_one_another(refusals, rows):
    state, end_ns = NEW, 0
    for is_refused in refusals:
        begins_ns, ends_ns = span_due(state, 0, 10**19)
        assert begins_ns <= end_ns <= ends_ns
        assert ends_ns - begins_ns <= LONGEST_DAYS * NS_PER_DAY
        end_ns = ends_ns
        state = refused(state, begins_ns, ends_ns, rows, "why") if is_refused else looked_over(state, ends_ns)
        assert state.refused == ("why" if is_refused else "")


def test_what_more_rows_do_not_help_is_passed_over():
    for rows in (0, MOST_ROWS):
        assert refused(NEW, 0, NS_PER_DAY, rows, "another unit").begins_ns == NS_PER_DAY
    assert refused(NEW, 0, NS_PER_DAY, 96, "too few starts").begins_ns == 0
