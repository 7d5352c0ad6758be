"""One step of the watch: a look at a span, and where the gap has changed a diagnosis of what is new."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.attribution.intervals import TWO_SIDED
from wetwell.sim2real.diagnosis.diagnosis import Diagnosis, diagnose
from wetwell.sim2real.likelihood.priors import EVEN, Priors
from wetwell.sim2real.watch.agreement import ToldFault, asset_of
from wetwell.sim2real.watch.change import FALSE_CHANGES, changed_groups, step_ns
from wetwell.sim2real.watch.look import Look, Seen, Shift, look_at, span_s
from wetwell.sim2real.watch.naming import Diagnose, first_named, renamed, shifts_of, tried_again
from wetwell.sim2real.watch.state import MOST_LOOKS, KeptLook, WatchState

LEAST_NAMED_S = 21_600.0
"""Length of a recording after a change from which it is named; else the next look names it. [s]"""
WHOLE_S = 82_800.0
"""Length from which what stays unknown is not tried again with more: about a day. [s]"""
BEGAN = 0.1
"""Share of how far a group has gone from which on it counts as having begun to go there. [1]"""
DOUBLED = 2.0
"""Times the gap that matters at the first look, at which people are told. [1]"""


def diagnosed_plainly(
    recording: Recording, station: Station, only: Collection[str] | None, priors: Priors = EVEN
) -> Diagnosis:
    """Diagnosis effect by effect, with nothing known of other stations unless it is told."""
    return diagnose(recording, station, only=only, priors=priors)


def watched(
    state: WatchState,
    recording: Recording,
    faults: Sequence[ToldFault] = (),
    diagnosed: Diagnose = diagnosed_plainly,
) -> WatchState:
    """State after a look at what was recorded since the last one.

    The first recording is diagnosed. Each further one is replayed under the file and what is called so far. Where a
    group has changed, the part after the change is diagnosed, and what is found is called so from then on.

    Parameters
    ----------
    state : WatchState
    recording : Recording
        Prepared: times rise; usually a day. Columns of truth are not read.
    faults : sequence of ToldFault
        Faults that the detector tells.
    diagnosed : callable

    Raises
    ------
    ValueError
        If the recording cannot be looked at: too short, too few starts, another station, other units.
    """
    drifting: dict[str, float] = {}
    step: int | None = None
    if state.looked_ns is None:
        state = first_named(state, recording, diagnosed)
    else:
        seen = look_at(recording, state.believed())
        before = shifts_of(state.reference)
        changed = _changed(seen, before)
        drifting = changed_groups(seen.look.shifts, before, least=0.0)
        unsettled = next((one for one in state.called if one.effect is None and one.span_s < WHOLE_S), None)
        if changed or drifting:
            group, distance = max((changed or drifting).items(), key=lambda pair: _weight(seen, *pair))
            step = _step_ns(seen, group, before)
            part = _from(recording, step)
            if changed and span_s(part) >= LEAST_NAMED_S:
                state = renamed(state, part, _began_ns(state, group, distance, step), diagnosed)
        if not changed and unsettled is not None and span_s(recording) > unsettled.span_s:
            state = tried_again(state, unsettled, recording, diagnosed)
    state = _told(state, faults, int(recording.time_ns[-1]))
    look = look_at(recording, state.believed(only_faults=True)).look
    return _looked(state, look, drifting, step, faults)


def _changed(seen: Seen, before: Mapping[str, Shift]) -> dict[str, float]:
    """Groups that have changed over the look, or over its last hours: what came late is lost in the mean of a day."""
    found = changed_groups(seen.look.shifts, before, false=FALSE_CHANGES / 2.0)
    found |= changed_groups(seen.last(LEAST_NAMED_S), before, false=FALSE_CHANGES / 2.0)
    return dict(sorted(found.items(), key=lambda pair: -abs(pair[1])))


def _weight(seen: Seen, group: str, distance: float) -> tuple[int, float]:
    """How well a group tells when it changed: by its cycles, then by how far it went."""
    return seen.series[group][0].size, abs(distance)


def _step_ns(seen: Seen, group: str, before: Mapping[str, Shift]) -> int:
    """When a group changed; the begin of the look where it has changed in its first cycle."""
    time_ns, means = seen.series[group]
    known = before.get(group)
    found_ns = step_ns(time_ns, means, 0.0 if known is None else known.mean)
    return seen.look.start_ns if found_ns == time_ns[0] else found_ns


def _began_ns(state: WatchState, group: str, distance: float, step: int) -> int:
    """When a group began to go where it is: the first of the looks up to now that all found it on the way there."""
    began_ns = step
    for look in reversed(state.looks):
        if look.drifting.get(group, 0.0) / distance < BEGAN:
            break
        began_ns = look.start_ns if look.step_ns is None else look.step_ns
    return began_ns


def _told(state: WatchState, faults: Sequence[ToldFault], end_ns: int) -> WatchState:
    """State in which what the detector tells as a fault is marked so."""
    called = tuple(
        one
        if one.since_ns is None or one.fault is not None
        else one.model_copy(update={"fault": asset_of(one.effect, one.component, faults, one.since_ns, end_ns)})
        for one in state.called
    )
    return state.model_copy(update={"called": called})


def _looked(
    state: WatchState, look: Look, drifting: dict[str, float], step: int | None, faults: Sequence[ToldFault]
) -> WatchState:
    """State with a look added, and whether the gap that matters has doubled.

    It has where its interval lies beyond, and has not any more where its interval lies within. While the detector
    tells a fault that began later than the first look, and nothing else is called since, the growth is that fault.
    """
    group = max(look.shifts, key=lambda name: abs(look.shifts[name].mean), default="")
    shift = look.shifts.get(group)
    matters, error = (0.0, 0.0) if shift is None else (abs(shift.mean), TWO_SIDED * shift.error)
    is_first = not state.looks
    first_matters = matters if is_first else state.first_matters
    limit = max(DOUBLED * first_matters, 1.0)
    low, high = max(matters - error, 0.0), matters + error
    is_doubled = not is_first and (low > limit or (state.is_doubled and high > limit))
    first_ns = look.end_ns if is_first else state.looks[0].end_ns
    has_own = any(one.since_ns is not None and one.fault is None for one in state.called)
    if not has_own and any(
        fault.since_ns > first_ns and fault.reaches(look.start_ns, look.end_ns) for fault in faults
    ):
        is_doubled = False
    kept = KeptLook(
        start_ns=look.start_ns,
        end_ns=look.end_ns,
        gap=look.gap,
        group=group,
        matters=matters,
        interval=(low, high),
        drifting=drifting,
        step_ns=step,
    )
    return state.model_copy(
        update={
            "looked_ns": look.end_ns,
            "first_matters": kept.matters if is_first else state.first_matters,
            "is_doubled": is_doubled,
            "looks": (*state.looks, kept)[-MOST_LOOKS:],
            "refused": "",
        }
    )


def _from(recording: Recording, start_ns: int) -> Recording:
    """Rows from a time on."""
    rows = slice(int(np.searchsorted(recording.time_ns, start_ns)), None)
    return replace(
        recording,
        time_ns=recording.time_ns[rows],
        columns={name: values[rows] for name, values in recording.columns.items()},
        truth={},
    )
