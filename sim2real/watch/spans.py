"""Which span of a station's history is looked at next."""

from wetwell.protocols.timestamps import NS_PER_DAY
from wetwell.sim2real.watch.state import WatchState

LONGEST_DAYS = 14
"""Days that a span grows to where shorter ones are refused: slow rows need some to show six starts."""
MOST_ROWS = 172_800
"""Rows with which a span is long enough: what is refused then is not refused for want of rows."""


def span_due(state: WatchState, first_ns: int, newest_ns: int) -> tuple[int, int] | None:
    """Span to look at, from its begin until before its end; None while it is not yet over.

    Parameters
    ----------
    state : WatchState
    first_ns, newest_ns : int
        Times of the first and the last sample that were kept.
    """
    begins_ns = max(first_ns if state.begins_ns is None else state.begins_ns, first_ns)
    ends_ns = begins_ns + (1 + state.refusals) * NS_PER_DAY
    return (begins_ns, ends_ns) if newest_ns >= ends_ns else None


def looked_over(state: WatchState, ends_ns: int) -> WatchState:
    """State after a span was looked at."""
    return state.model_copy(update={"begins_ns": ends_ns, "refused": "", "refusals": 0})


def refused(state: WatchState, begins_ns: int, ends_ns: int, rows: int, why: str) -> WatchState:
    """State after a span was refused: it is tried again a day longer, or passed over where that would not help."""
    is_passed = rows >= MOST_ROWS or state.refusals + 1 >= LONGEST_DAYS or rows == 0
    return state.model_copy(
        update={
            "begins_ns": ends_ns if is_passed else begins_ns,
            "refused": why,
            "refusals": 0 if is_passed else state.refusals + 1,
        }
    )
