"""A station file with estimates in it."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any

import numpy as np
from pydantic import ValidationError

from wetwell.protocols.errors import first_fault
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.calibration.estimates import Estimate
from wetwell.sim2real.calibration.power_estimates import KEYS, power_lines

CURVE_KEYS = ("head_scale", "flow_scale")


def with_estimates(station: Station, estimates: Iterable[Estimate]) -> Station:
    """Station with what was estimated in the place of what was configured; the rest stays.

    Raises
    ------
    ValueError
        If the estimates cannot be a station together, such as a stop level over its start level.
    """
    told = {one.place: one.value for one in estimates if one.interval is not None and one.place}
    tree: dict[str, Any] = station.model_dump(exclude_none=True)
    for place, value in told.items():
        table: Any = tree
        for step in place[:-1]:
            table = table[step]
        if place[0] == "pump":
            continue
        if isinstance(table, tuple):  # one of several levels
            levels = list(table)
            levels[int(place[-1])] = value
            tree[str(place[0])][place[1]] = levels
        else:
            table[place[-1]] = value
    for i in range(len(station.pump)):
        _change_pump(
            tree["pump"][i],
            station,
            i,
            {place[2]: value for place, value in told.items() if place[:2] == ("pump", i)},
        )
    try:
        return Station.model_validate(tree)
    except ValidationError as error:
        raise ValueError(f"the estimates do not make a station: {first_fault(error)}") from error


def _change_pump(table: dict[str, Any], station: Station, i: int, told: dict[str | int, float]) -> None:
    """Write the changed curve and line of power of a pump, from 0, into its table."""
    if told.keys() & set(CURVE_KEYS):
        head, flow = (told.get(key, 1.0) for key in CURVE_KEYS)
        c0, c1, c2 = station.pump[i].coefficients
        table.pop("points", None)
        table["curve"] = (head * c0, head * c1 / flow, head * c2 / flow**2)
    if told.keys() & set(KEYS):
        table.pop("efficiency_points", None)
        scale, slope = told.get(KEYS[0], 1.0), told.get(KEYS[1], 0.0)
        table["power_points"] = power_lines(station, [i]).points(np.array([scale, slope]), 0)


def possible_estimates(station: Station, estimates: Sequence[Estimate]) -> list[Estimate]:
    """The same estimates, but kept are those with which the file would break a rule; the reason says which."""
    kept: list[Estimate] = list(estimates)
    try:
        with_estimates(station, kept)
    except ValueError:
        kept = []
        for _, group in groupby(estimates, key=_stands_with):
            members = list(group)
            try:
                with_estimates(station, [*kept, *members])
            except ValueError as error:
                members = [_withdrawn(one, station, str(error)) for one in members]
            kept += members
    return kept


def _stands_with(estimate: Estimate) -> tuple[object, ...]:
    """What is right or wrong together: size and slope of a curve or line of a pump; all others stand alone."""
    return estimate.place[:2] if estimate.place[:1] == ("pump",) else (estimate.name,)


def _withdrawn(estimate: Estimate, station: Station, rule: str) -> Estimate:
    """The estimate as kept, with its value from the file."""
    if estimate.interval is None:
        return estimate
    table: Any = station.model_dump()
    for step in estimate.place if estimate.place[:1] != ("pump",) else ():
        table = table[step]
    value = estimate.prior[0] if estimate.prior is not None else table
    return replace(estimate, value=float(value), interval=None, reason=f"{estimate.value:.4g} seen, but {rule}")
