"""Scenario: what happens to a station, from the weather to the faults."""

from typing import Annotated

from pydantic import Field

from wetwell.protocols.messages.message import Stamp
from wetwell.protocols.station.station_file import NAME_PATTERN
from wetwell.protocols.station.table import Finite, Positive, Table
from wetwell.simulator.faults import Fault
from wetwell.simulator.inflow import Inflow
from wetwell.simulator.inflow.empirical import EmpiricalInflow

DEFAULT_START_NS = 1_735_689_600_000_000_000
"""2025-01-01T00:00:00Z: a fixed date, so that the same seed gives the same bytes."""


class Scenario(Table):
    """Inflow, faults, start and length.

    Parameters
    ----------
    name : str
        What people and logs call it.
    description : str
        One line for people.
    duration_s : float
        Length of a batch run where none is asked for; a live run goes on after it. [s]
    start_time : stamp, optional
        Time of the first sample. Without it a live run at the speed of life starts now, every other at
        `DEFAULT_START_NS`.
    initial_level_m : float
        In the wet well at the beginning. [m]
    clock_speed : float
        Seconds of the station in a second on the wall, where none is asked for. [1]
    inflow : one of the inflow models
        What comes to the wet well.
    fault : sequence of faults
        What goes wrong; any number at once.
    """

    name: Annotated[str, Field(pattern=NAME_PATTERN)]
    description: str = ""
    duration_s: Positive = 172_800.0
    start_time: Stamp | None = None
    initial_level_m: Finite = 1.0
    clock_speed: Positive = 1.0
    inflow: Inflow = EmpiricalInflow()
    fault: tuple[Fault, ...] = ()
