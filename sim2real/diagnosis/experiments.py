"""What to do next: the experiment that would tell apart what a diagnosis leaves open."""

from collections.abc import Collection

_PAIRS: dict[frozenset[str], str] = {
    frozenset({"friction_bias", "static_head_bias"}): (
        "Run two pumps at once, or one at three speeds: friction grows with the square of the flow, static head not."
    ),
    frozenset({"pump_wear", "motor_slip"}): (
        "Run one pump at two speeds, or measure the speed of the shaft: slip follows the torque, wear does not."
    ),
    frozenset({"pump_wear", "ragging"}): "Let a pump run for an hour, then reverse it: rags are shed, wear stays.",
    frozenset({"motor_slip", "ragging"}): "Let one pump run for an hour: rags gather, slip stays as it is.",
    frozenset({"unmetered_inflow", "check_valve_leak"}): (
        "Shut the isolation valve of a standing pump for an hour: a leak through its check valve ends, an inflow not."
    ),
    frozenset({"static_head_bias", "level_dependent_static_head"}): (
        "Pump from the highest to the lowest level in one run: a lift that follows the level changes on the way."
    ),
    frozenset({"flow_meter_lag", "channel_delay"}): (
        "Trip a pump at full speed: a damped meter falls off slowly, a late channel falls at once, but late."
    ),
    frozenset({"flow_meter_lag", "water_inertia"}): (
        "Compare flow and head in a start: inertia keeps them on the pump curve, damping does not."
    ),
    frozenset(
        {"static_head_bias", "air_pocket"}
    ): "Let the station stand for hours, then watch one long run: air is purged.",
    frozenset({"control_delay", "threshold_shift"}): (
        "Compare starts at low and at high inflow: a late controller overshoots by the slope of the level."
    ),
}


def next_experiment(verdict: str, names: Collection[str], equivalent: Collection[str], component: str | None) -> str:
    """Advice in one or two sentences.

    Parameters
    ----------
    verdict : str
        "effect", "none" or "unknown".
    names, equivalent : collections of str
        Accepted effects, and those that the data cannot tell from them.
    component : str or None
        The one held responsible.
    """
    if verdict == "none":
        return "Nothing to explain: record again after the next change of the station."
    if verdict == "unknown":
        return (
            "No effect of the library explains this gap: inspect the "
            f"{(component or 'station').replace('_', ' ')} on site, record its signals against an independent "
            "instrument, and add the effect that is found to the library."
        )
    for name in names:
        for other in equivalent:
            if frozenset({name, other}) in _PAIRS:
                return _PAIRS[frozenset({name, other})]
    if equivalent:
        return (
            f"Vary speed, level and number of pumps: these data cannot tell {' from '.join([*names, *equivalent])}."
        )
    return "Run the simulator with the new station file, and diagnose a recording of another week to confirm it."
