"""What a watched station says to others of its kind."""

from wetwell.sim2real.fleet.fleet_prior import Finding
from wetwell.sim2real.watch.state import WatchState


def finding_of(state: WatchState) -> Finding | None:
    """What a station was found to have by its own recordings, faults left out; None before its first look."""
    if not state.looks:
        return None
    effects = tuple(one.own for one in state.called if one.own is not None and one.fault is None)
    return Finding(station=state.station.name, effects=effects)
