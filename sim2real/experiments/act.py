"""What an act is: what a crew or an operator does at a station, for how long, and with how many hands."""

from dataclasses import dataclass

from wetwell.protocols.orders import Step
from wetwell.protocols.station.station_file import Station


@dataclass(frozen=True, slots=True, kw_only=True)
class Act:
    """An act at a station.

    Attributes
    ----------
    name : str
    sentence : str
        What to do, for those who do it.
    steps : tuple of Step
    people : int
        Who are needed for as long as it takes: one at the screens, or two at the station.
    travel_h : float
        Way to the station and back, of each of them. [h]
    """

    name: str
    sentence: str
    steps: tuple[Step, ...]
    people: int = 1
    travel_h: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """What acts are made of: the pumps that may run, and the levels between which an operator may go.

    Attributes
    ----------
    pumps : int
    ready : tuple of int
        Pumps that are in service, from 0.
    apart : tuple of int
        Those of them that are worth a run of their own, from 0.
    least_ratio : float
        Least speed of a drive, as a share of nominal. [1]
    low_m, stop_m, brim_m, high_m : float
        Down to which the wet well may be emptied by hand; where the last pump stops; up to which it is filled by
        hand; where the last pump starts. [m]
    """

    pumps: int
    ready: tuple[int, ...]
    apart: tuple[int, ...]
    least_ratio: float
    low_m: float
    stop_m: float
    brim_m: float
    high_m: float

    def speeds(self, ratio: float, *running: int) -> tuple[float, ...]:
        """Speeds of all pumps, some of them running. [1]."""
        return tuple(ratio if i in running else 0.0 for i in range(self.pumps))

    def fill(self, level_m: float) -> Step:
        """All pumps stand until the level is there. [m]."""
        return Step(longest_s=LONGEST_FILL_S, speed_ratio=self.speeds(0.0), high_m=level_m)


LONGEST_FILL_S = 3600.0
"""Longest time for which an operator waits for the wet well to fill. [s]"""
LOW_SHARE = 0.3
"""Share of the depth under the lowest stop level that an operator takes away: inlets of pumps must stay under. [1]"""
BRIM_SHARE = 0.1
"""Share of the depth between the lowest stop and the highest start level that an operator keeps free. [1]"""


def site_of(station: Station, singled_out: set[int]) -> Site:
    """Site of a station.

    Parameters
    ----------
    station : Station
        With start and stop levels.
    singled_out : set of int
        Pumps (from 1) to which something may be confined that is looked for; the first in service always is tried.
    """
    control = station.control
    ready = tuple(i for i in range(len(station.pump)) if i + 1 not in control.out_of_service)
    stop_m, high_m = control.stop_levels_m[0], control.start_levels_m[-1]
    return Site(
        pumps=len(station.pump),
        ready=ready,
        apart=tuple(i for i in ready if i == ready[0] or i + 1 in singled_out),
        least_ratio=control.min_frequency_hz / min(pump.nominal_frequency_hz for pump in station.pump),
        low_m=stop_m - LOW_SHARE * (stop_m - station.sump.floor_level_m),
        stop_m=stop_m,
        brim_m=high_m - BRIM_SHARE * (high_m - stop_m),
        high_m=high_m,
    )
