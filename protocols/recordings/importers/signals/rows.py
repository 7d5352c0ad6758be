"""Events made into the rows of a recording: those of the file, or a grid on which values are held."""

from collections.abc import Mapping, Sequence

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.recordings.importers.signals.events import Events
from wetwell.protocols.timestamps import NS_PER_S

_STEPS_S = (1, 2, 5, 10, 15, 20, 30, 60, 120, 300, 600, 900, 1800, 3600)
_COINCIDING = 0.5
MOST_ROWS = 50_000_000


def found_step_s(events: Sequence[Events]) -> float:
    """Usual distance of the stamps of a tag, as a round number of seconds; the median over the tags. [s]."""
    steps_ns = [np.diff(part.time_ns) for part in events]
    steps_s = [float(np.median(step_ns[step_ns > 0])) / NS_PER_S for step_ns in steps_ns if np.any(step_ns > 0)]
    usual_s = float(np.median(steps_s)) if steps_s else 1.0
    return float(min(_STEPS_S, key=lambda step_s: abs(np.log(step_s / max(usual_s, 1e-9)))))


def coincide(events: Sequence[Events]) -> bool:
    """Whether the tags are stored at the same stamps: most of those of the others are those of the busiest tag."""
    sizes = [int(np.sum(np.diff(part.time_ns) > 0)) + 1 for part in events]
    others = sum(sizes) - max(sizes)
    return sum(sizes) - union_ns(events).size >= _COINCIDING * others


def union_ns(events: Sequence[Events]) -> Integers:
    """Stamps that any tag has. [ns]."""
    first = events[0].time_ns
    if all(np.array_equal(part.time_ns, first) for part in events) and np.all(np.diff(first) > 0):
        return first
    time_ns = np.sort(np.concatenate([part.time_ns for part in events]), kind="stable")
    return np.asarray(time_ns[np.append(True, np.diff(time_ns) > 0)])


def on_union(events: Sequence[Events]) -> tuple[Integers, dict[str, Floats]]:
    """Rows at all stamps of the file; of several values at the same stamp the last one counts."""
    time_ns = union_ns(events)
    columns: dict[str, Floats] = {}
    for part in events:
        places = None if np.array_equal(part.time_ns, time_ns) else np.searchsorted(time_ns, part.time_ns)
        for name, values in part.values.items():
            said = part.is_event[name]
            column = columns.setdefault(name, np.full(time_ns.size, np.nan))
            if places is None:
                np.copyto(column, values, where=said)
            else:
                column[places[said]] = values[said]
    return time_ns, columns


def on_grid(
    events: Sequence[Events], step_ns: int, max_age_ns: Mapping[str, int]
) -> tuple[Integers, dict[str, Floats]]:
    """Rows at the multiples of a step, each with the last value that is not too old.

    Parameters
    ----------
    events : sequence of Events
    step_ns : int
        [ns]
    max_age_ns : mapping of signal to int
        Values that are older are none. [ns]

    Raises
    ------
    ValueError
        If there would be more than `MOST_ROWS`.
    """
    first = min(-(-int(part.time_ns[0]) // step_ns) for part in events if part.time_ns.size)
    last = max(-(-int(part.time_ns[-1]) // step_ns) for part in events if part.time_ns.size)
    if last - first >= MOST_ROWS:
        rows = last - first + 1
        raise ValueError(f"step_s: {step_ns / NS_PER_S:g} s makes {rows} rows of these files, at most {MOST_ROWS}")
    time_ns = np.arange(first, last + 1, dtype=np.int64) * step_ns
    columns: dict[str, Floats] = {}
    stored_ns: dict[str, Integers] = {}
    for part in events:
        for name, values in part.values.items():
            said = part.is_event[name]
            held, held_ns = _held(part.time_ns[said], values[said], time_ns, max_age_ns[name])
            if name in columns:  # of several tables the one that spoke last
                is_newer = held_ns > stored_ns[name]
                held, held_ns = np.where(is_newer, held, columns[name]), np.where(is_newer, held_ns, stored_ns[name])
            columns[name], stored_ns[name] = held, held_ns
    return time_ns, columns


def _held(event_ns: Integers, values: Floats, time_ns: Integers, max_age_ns: int) -> tuple[Floats, Integers]:
    """Last value at each time, and since when it is stored."""
    if event_ns.size == 0:
        return np.full(time_ns.size, np.nan), np.full(time_ns.size, np.iinfo(np.int64).min)
    last = np.searchsorted(event_ns, time_ns, side="right") - 1
    since_ns = np.where(last >= 0, event_ns[last], np.iinfo(np.int64).min)
    is_fresh = (last >= 0) & (time_ns - event_ns[last] <= max_age_ns)
    return np.where(is_fresh, values[last], np.nan), since_ns
