"""What to do about a verdict, and what that is expected to cost."""

from collections.abc import Mapping
from typing import Any

from wetwell.detector.inference.posterior import FAULT_STATES
from wetwell.protocols.messages.verdict import State
from wetwell.protocols.station.costs import Costs

_CURED: Mapping[str, frozenset[State]] = {
    "wait": frozenset(),
    "pull the pump": frozenset({"pump_fault"}),
    "flush the main": frozenset({"system_fault"}),
    "pull the pump and flush the main": frozenset({"pump_fault", "system_fault", "pump_and_system_fault"}),
    "check the meter": frozenset({"sensor_fault"}),
}
_UNCURED: Mapping[str, tuple[State, ...]] = {
    act: tuple(state for state in FAULT_STATES if state not in cured) for act, cured in _CURED.items()
}
"""Faults that an act leaves as they are."""


def expected_costs(probability: Mapping[State, float], wasted_kwh_per_day: float, costs: Costs) -> dict[str, Any]:
    """Expected cost of each act, the cheapest first, as a message carries it.

    An act costs its crew; a fault that it does not cure costs the energy that it wastes until the next visit, and a
    call-out with the probability that the station fails before; a wrong meter that is left costs a crew sent in vain.

    Parameters
    ----------
    probability : mapping
        Of the states.
    wasted_kwh_per_day : float
        Energy that the fault, if there is one, wastes. [kWh/d]
    costs : Costs

    Examples
    --------
    >>> table = expected_costs({"normal": 0.01, "pump_fault": 0.99}, 20.0, Costs())
    >>> table["cheapest"], table["expected"]["wait"]
    ('pull the pump', 1306.8)
    """
    crews = {
        "wait": 0.0,
        "pull the pump": costs.pull_pump,
        "flush the main": costs.flush_main,
        "pull the pump and flush the main": costs.pull_pump + costs.flush_main,
        "check the meter": costs.check_meter,
    }
    energy = max(wasted_kwh_per_day, 0.0) * costs.horizon_days * costs.energy_per_kwh
    left = costs.failure_share * costs.call_out + energy
    expected = {}
    for act, faults in _UNCURED.items():
        uncured = sum(probability.get(state, 0.0) for state in faults)
        blind = 0.0 if act == "check the meter" else probability.get("sensor_fault", 0.0) * costs.pull_pump
        expected[act] = round(crews[act] + uncured * left + blind, 1)
    ordered = dict(sorted(expected.items(), key=lambda item: item[1]))
    return {"cheapest": next(iter(ordered)), "expected": ordered}


_ADVICE: Mapping[State, str] = {
    "pump_fault": "pull the pump: look for rags, a worn impeller or wear ring",
    "system_fault": "flush the main: look for deposits, air at high points, a valve that is not open",
    "pump_and_system_fault": "pull the pump and flush the main",
    "sensor_fault": "check the meter before a crew goes out",
    "unknown": "not enough to send a crew: wait for the next runs, or check the meters",
    "normal": "nothing to do",
    "learning": "nothing yet: the healthy station is being learnt",
}


def advice(state: State, detail: str | None = None) -> str:
    """What to do, in plain words."""
    return f"{_ADVICE[state]} ({detail})" if detail else _ADVICE[state]
