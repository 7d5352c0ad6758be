"""Local time with daylight saving turned into UTC: the hour that comes twice, and the one that is missing."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import numpy as np

from wetwell.protocols.arrays import Flags, Integers
from wetwell.protocols.timestamps import NS_PER_S

_DAY_S = 86_400
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass(frozen=True, slots=True, kw_only=True)
class UtcTimes:
    """Local stamps in UTC.

    Attributes
    ----------
    time_ns : (n,) int64
        [ns]
    is_missing : (n,) bool
        Stamps in an hour that the clocks left out; their time means nothing.
    undecided : int
        Stamps in an hour that came twice, of which the rows do not say whether it is the first or the second time;
        the first is taken.
    """

    time_ns: Integers
    is_missing: Flags
    undecided: int


def to_utc(local_ns: Integers, zone: ZoneInfo) -> UtcTimes:
    """Stamps of one tag, or of one table, in UTC.

    In the hour that comes twice the rows are those of the first time until the clock goes back. If it never does and
    every stamp stands there twice, the second of each is the second time. Rows may run backward as a whole.

    Parameters
    ----------
    local_ns : (n,) int64
        Nanoseconds since 1970 on the local clock, in the order of the rows. [ns]
    zone : ZoneInfo

    Examples
    --------
    >>> local = [datetime(2024, 10, 27, 3, minute) for minute in (0, 30, 0, 30)]
    >>> local_ns = np.array(local, dtype="datetime64[ns]").astype(np.int64)
    >>> to_utc(local_ns, ZoneInfo("Europe/Helsinki")).time_ns.astype("datetime64[ns]").astype("datetime64[m]")
    array(['2024-10-27T00:00', '2024-10-27T00:30', '2024-10-27T01:00',
           '2024-10-27T01:30'], dtype='datetime64[m]')
    """
    if local_ns.size == 0:
        return UtcTimes(time_ns=local_ns, is_missing=np.zeros(0, dtype=bool), undecided=0)
    change_s, offset_s = _changes(local_ns, zone)
    begin_ns = (change_s + offset_s) * NS_PER_S  # on the local clock after each change
    end_ns = np.append((change_s[1:] + offset_s[:-1]) * NS_PER_S, np.iinfo(np.int64).max)
    after = np.maximum(np.searchsorted(begin_ns, local_ns, side="right") - 1, 0)
    is_missing = local_ns >= end_ns[after]
    is_double = (after > 0) & (local_ns < end_ns[np.maximum(after - 1, 0)])
    doubles = np.flatnonzero(is_double)
    is_first, undecided = _first_times(local_ns, after, doubles)
    after[doubles[is_first]] -= 1
    return UtcTimes(time_ns=local_ns - offset_s[after] * NS_PER_S, is_missing=is_missing, undecided=undecided)


def _changes(local_ns: Integers, zone: ZoneInfo) -> tuple[Integers, Integers]:
    """Times since 1970 at which the offset of a zone changes around some stamps, and the offset from then on. [s]."""
    days = np.unique(local_ns // (_DAY_S * NS_PER_S))
    days = np.unique(np.concatenate([days + shift for shift in (-1, 0, 1, 2)]))
    offsets_s = [_offset_s(int(day) * _DAY_S, zone) for day in days.tolist()]
    changes = [(int(days[0]) * _DAY_S - _DAY_S, offsets_s[0])]
    for place in range(1, days.size):
        if offsets_s[place] != offsets_s[place - 1]:
            low_s, high_s = int(days[place - 1]) * _DAY_S, int(days[place]) * _DAY_S
            while high_s - low_s > 1:
                middle_s = (low_s + high_s) // 2
                is_before = _offset_s(middle_s, zone) == offsets_s[place - 1]
                low_s, high_s = (middle_s, high_s) if is_before else (low_s, middle_s)
            changes.append((high_s, offsets_s[place]))
    change_s, offset_s = np.array(changes, dtype=np.int64).T
    return change_s, offset_s


def _offset_s(stamp_s: int, zone: ZoneInfo) -> int:
    offset = (_EPOCH + timedelta(seconds=stamp_s)).astimezone(zone).utcoffset()
    return 0 if offset is None else round(offset.total_seconds())


def _first_times(local_ns: Integers, after: Integers, doubles: Integers) -> tuple[Flags, int]:
    """Which of the doubled stamps are of the first time, and how many of them nobody can tell."""
    is_first = np.ones(doubles.size, dtype=bool)
    undecided = 0
    steps_ns = np.diff(local_ns)
    is_backward = np.sum(steps_ns < 0) > np.sum(steps_ns > 0)
    for change in np.unique(after[doubles]):
        members = np.flatnonzero(after[doubles] == change)
        members = members[::-1] if is_backward else members
        times_ns = local_ns[doubles[members]]
        back = np.flatnonzero(np.diff(times_ns) < 0)
        _, places, counts = np.unique(times_ns, return_index=True, return_counts=True)
        if back.size == 1:
            is_first[members[back[0] + 1 :]] = False
        elif back.size == 0 and np.all(counts == 2):
            is_first[np.delete(members, places)] = False
        else:
            undecided += members.size
    return is_first, undecided
