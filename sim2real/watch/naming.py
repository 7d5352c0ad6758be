"""What a gap is called after it has changed: what is over, what has grown, what is new."""

from collections.abc import Callable, Collection, Mapping, Sequence

from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import EffectTable, Station
from wetwell.sim2real.diagnosis.diagnosis import Diagnosis
from wetwell.sim2real.diagnosis.report import FoundEffect
from wetwell.sim2real.watch.change import changed_groups
from wetwell.sim2real.watch.look import Seen, Shift, look_at, span_s
from wetwell.sim2real.watch.state import MOST_PAST, Called, Ended, KeptShift, WatchState

Diagnose = Callable[[Recording, Station, Collection[str] | None], Diagnosis]
"""Diagnoses a recording against a station, with all of the library or only some names."""


def first_named(state: WatchState, recording: Recording, diagnosed: Diagnose) -> WatchState:
    """State after the first recording of a station was diagnosed."""
    return _settled(state, _called(diagnosed(recording, state.station, None), None, recording, {}), recording)


def renamed(state: WatchState, part: Recording, since_ns: int, diagnosed: Diagnose) -> WatchState:
    """State after the recording of a station that has changed: what is over is looked for first, then what is new.

    An effect that has grown is fitted anew together with what it was before, and keeps the time when it began.

    Parameters
    ----------
    state : WatchState
    part : Recording
        From the change on.
    since_ns : int
        When it began.
    diagnosed : callable
    """
    for one in state.called:
        if one.since_ns is not None and one.table is not None and _is_over(state, one, part):
            past = (*state.past, Ended(called=one, ended_ns=since_ns))[-MOST_PAST:]
            return _settled(state.model_copy(update={"past": past}), _others(state, [one]), part)
    new = _called(diagnosed(part, state.believed(), None), since_ns, part, state.reference)
    if not new:
        return state
    grown = {one.name: one for one in state.called if one.name in {each.name for each in new}}
    if grown and None not in grown:
        names = {one.name for one in (*grown.values(), *new) if one.name is not None}
        rest = list(grown.values())
        again = _called(diagnosed(part, state.believed(rest), names), since_ns, part, state.reference)
        if all(one.name is not None for one in again):
            return _settled(state, (*_others(state, rest), *(_since_before(one, grown) for one in again)), part)
    return _settled(state, (*state.called, *new), part)


def tried_again(state: WatchState, unknown: Called, recording: Recording, diagnosed: Diagnose) -> WatchState:
    """State after what was unknown by a short recording was diagnosed by a longer one."""
    found = diagnosed(recording, state.believed([unknown]), None)
    new = _called(found, unknown.since_ns, recording, unknown.before)
    return _settled(state, (*_others(state, [unknown]), *new), recording)


def shifts_of(kept: Mapping[str, KeptShift]) -> dict[str, Shift]:
    """Shifts as they were before they were kept."""
    return {name: Shift(**dict(shift)) for name, shift in kept.items()}


def kept_shifts(seen: Seen) -> dict[str, KeptShift]:
    """Shifts of a look as they are kept."""
    return {
        name: KeptShift(mean=shift.mean, error=shift.error, cycles=shift.cycles)
        for name, shift in seen.look.shifts.items()
    }


def _settled(state: WatchState, called: tuple[Called, ...], part: Recording) -> WatchState:
    """State with other names, held from now on against how the station is under them."""
    state = state.model_copy(update={"called": called})
    return state.model_copy(update={"reference": kept_shifts(look_at(part, state.believed()))})


def _others(state: WatchState, some: Sequence[Called]) -> tuple[Called, ...]:
    return tuple(one for one in state.called if one not in some)


def _since_before(one: Called, grown: Mapping[str | None, Called]) -> Called:
    """What is called anew, with the time when it began where it was called so before."""
    before = grown.get(one.name)
    if before is None:
        return one
    return one.model_copy(update={"since_ns": before.since_ns, "before": before.before})


def _is_over(state: WatchState, one: Called, part: Recording) -> bool:
    """Whether a station lies again where it lay before something was called so, if that is left out."""
    shifts = look_at(part, state.believed([one])).look.shifts
    return not changed_groups(shifts, shifts_of(one.before))


def _called(
    found: Diagnosis, since_ns: int | None, recording: Recording, before: Mapping[str, KeptShift]
) -> tuple[Called, ...]:
    """What a diagnosis calls the gap, effect by effect; nothing where there is none."""
    if found.verdict == "none":
        return ()
    probability = sum(one.probability for one in found.posterior if one.verdict == found.verdict)

    def called(
        component: str,
        effect: FoundEffect | None = None,
        own: FoundEffect | None = None,
        table: EffectTable | None = None,
    ) -> Called:
        return Called(
            effect=effect,
            own=own,
            table=table,
            component=component,
            probability=probability,
            since_ns=since_ns,
            named_ns=int(recording.time_ns[-1]),
            span_s=span_s(recording),
            before=dict(before),
        )

    if found.verdict == "unknown":
        return (called(found.where[0].component if found.where else next(iter(found.component_probability))),)
    tables = found.station.effect[len(found.own_station.effect) :][: len(found.effects)]
    parts = zip(found.effects, found.own_effects, tables, strict=True)
    return tuple(called(effect.component, effect, own, table) for effect, own, table in parts)
