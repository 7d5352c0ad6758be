"""The clock of a station, as its samples tell it."""

from dataclasses import dataclass

from wetwell.protocols.timestamps import MAX_STAMP_NS, NS_PER_S


@dataclass(frozen=True)
class Now:
    """The time of day, for stamps, and a clock that nobody sets, for silence."""

    wall_ns: int
    steady_s: float


@dataclass(frozen=True)
class StationClock:
    """Time of a station: that of its samples, running on at the pace of the wall.

    A sample that is ahead of the clock sets it. One behind may be late, as after a link that was lost: late ones come
    faster than they were taken, until they have caught up. Where two in a row are behind and come no faster, the
    clock of the station was set back, or runs slowly, and this one follows.
    """

    time_ns: int
    at_s: float
    """The clock said `time_ns` at this steady time. [s]"""
    sample_ns: int
    sample_s: float
    """Time of the last sample, and the steady time at which it came. [s]"""
    is_slow: bool = False
    """Whether the last sample was behind, and came no faster than it was taken."""

    def now_ns(self, now: Now) -> int:
        """What the clock says, in ns since 1970."""
        return min(self.time_ns + round((now.steady_s - self.at_s) * NS_PER_S), MAX_STAMP_NS)

    def after(self, sample_ns: int, now: Now) -> "StationClock":
        """The clock once a sample of this time has come."""
        is_behind = sample_ns < self.now_ns(now)
        is_faster = sample_ns - self.sample_ns > (now.steady_s - self.sample_s) * NS_PER_S
        if not is_behind or (self.is_slow and not is_faster):
            return set_by(sample_ns, now)
        return StationClock(self.time_ns, self.at_s, sample_ns, now.steady_s, is_slow=not is_faster)


def set_by(sample_ns: int, now: Now) -> StationClock:
    """The clock of a station of which this is the first sample."""
    return StationClock(sample_ns, now.steady_s, sample_ns, now.steady_s)


def went_on(sample_ns: int, ahead_ns: int | None, now: Now) -> StationClock:
    """The clock after a restart: it ran on while nobody looked.

    Parameters
    ----------
    sample_ns : int
        Time of the last sample. [ns]
    ahead_ns : int or None
        How far the clock was ahead of the time of day. [ns] None: not known, and it stood.
    now : Now
    """
    time_ns = sample_ns if ahead_ns is None else max(sample_ns, now.wall_ns + ahead_ns)
    return StationClock(min(time_ns, MAX_STAMP_NS), now.steady_s, sample_ns, now.steady_s)
