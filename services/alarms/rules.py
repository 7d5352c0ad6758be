"""The rule table: what is an alarm, how urgent, after what delays, and what to do."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from wetwell.protocols.messages.alarm import Priority, RuleName
from wetwell.protocols.messages.verdict import Verdict


@dataclass(frozen=True)
class Rule:
    """One kind of alarm. Delays are in seconds of the station's time."""

    priority: Priority
    text: str
    advice: str
    on_delay_s: float = 0.0
    off_delay_s: float = 0.0
    is_enabled: bool = True


RULES: Mapping[RuleName, Rule] = {
    "pump_fault": Rule("high", "pump fault", "pull the pump: look for rags, a worn impeller or wear ring"),
    "system_fault": Rule("high", "system fault", "flush the main: look for deposits, air, a valve that is not open"),
    "pump_and_system_fault": Rule("high", "pump and system fault", "pull the pump and flush the main"),
    "sensor_fault": Rule("medium", "sensor fault", "check the meter before a crew goes out"),
    "level_high": Rule(
        "high", "level high", "the pumps do not keep up: look at running pumps and inflow", 60.0, 60.0
    ),
    "overflow_risk": Rule("urgent", "level near overflow", "start all pumps, send a crew or a tanker", 10.0, 60.0),
    "samples_stale": Rule("high", "no samples", "the station is not seen: check PLC, gateway and network"),
    "plc_stopped": Rule("high", "heartbeat of the PLC stands still", "the PLC answers but its program does not run"),
    "plc_lost": Rule("high", "PLC does not answer", "check the PLC's power, network and address", 30.0),
    "detector_silent": Rule("high", "detector is not running", "nobody judges the pumps: start the detector"),
    "gateway_silent": Rule("high", "gateway is not running", "nobody polls the PLC: start the gateway"),
    "historian_silent": Rule("medium", "historian is not running", "nothing is kept: start the historian"),
    "bus_lost": Rule("high", "alarms had no router", "what happened meanwhile may be missing: check the router"),
}
"""Defaults; the setting `alarms.rules` changes priority, delays and whether a rule is there at all."""

VERDICT_RULES: tuple[RuleName, ...] = ("pump_fault", "system_fault", "pump_and_system_fault", "sensor_fault")
MAX_PUMPS = 32


def changed_rules(changes: Mapping[RuleName, Mapping[str, Any]]) -> dict[RuleName, Rule]:
    """The rule table with some fields of some rules changed."""
    return {name: replace(rule, **changes.get(name, {})) for name, rule in RULES.items()}


def alarm_id(rule: RuleName, pump: int | None = None) -> str:
    """Name of an alarm of a station.

    Examples
    --------
    >>> alarm_id("pump_fault", 2), alarm_id("level_high")
    ('pump2.pump_fault', 'level_high')
    """
    return rule if pump is None else f"pump{pump}.{rule}"


def parse_alarm_id(text: str) -> tuple[RuleName, int | None]:
    """Rule and pump of an alarm's name.

    Raises
    ------
    ValueError
        If no rule has such alarms.

    Examples
    --------
    >>> parse_alarm_id("pump2.pump_fault"), parse_alarm_id("level_high")
    (('pump_fault', 2), ('level_high', None))
    """
    prefix, dot, last = text.rpartition(".")
    for rule in RULES:
        if rule == last and (rule in VERDICT_RULES) == bool(dot):
            number = prefix.removeprefix("pump")
            if not dot:
                return rule, None
            if prefix.startswith("pump") and number.isdecimal() and 1 <= int(number) <= MAX_PUMPS:
                return rule, int(number)
    raise ValueError(f"alarm '{text}' is none of {', '.join(RULES)}, those of a pump with 'pump2.' before")


def verdict_text(verdict: Verdict) -> str:
    """What a verdict says, in one line for an operator.

    Examples
    --------
    >>> verdict_text(Verdict(
    ...     time=0, station="alpha", pump=2, state="pump_fault", probability={"pump_fault": 0.998}, onset=0,
    ...     window=(0, 0), evidence={"severity": {"speed_loss_percent": {"value": 9.1, "interval": [8.0, 10.2]}}}))
    'pump 2: pump fault, p = 0.998, speed loss 9.1 % (8 to 10.2)'
    """
    words = [f"pump {verdict.pump}: {verdict.state.replace('_', ' ')}"]
    if verdict.state in verdict.probability:
        words.append(f"p = {verdict.probability[verdict.state]:.3f}")
    for name, label, unit in _SEVERITY.get(verdict.state, ()):
        figure = _figure(verdict.evidence, name)
        if figure is not None:
            words.append(f"{label} {figure[0]:.3g} {unit} ({figure[1]:.3g} to {figure[2]:.3g})")
    return ", ".join(words)


def verdict_advice(verdict: Verdict, rule: Rule) -> str:
    """What to do: the verdict's own advice, else the rule's."""
    advice = verdict.evidence.get("advice")
    return advice[:500] if isinstance(advice, str) and advice else rule.advice


_SPEED, _FRICTION = ("speed_loss_percent", "speed loss", "%"), ("friction_rise_percent", "friction", "%")
_SEVERITY = {
    "pump_fault": (_SPEED,),
    "system_fault": (_FRICTION,),
    "pump_and_system_fault": (_SPEED, _FRICTION),
}


def _figure(evidence: Mapping[str, Any], name: str) -> tuple[float, float, float] | None:
    """Value and interval of a severity; None where a foreign sender has something else there."""
    try:
        figure = evidence["severity"][name]
        low, high = figure["interval"]
        return float(figure["value"]), float(low), float(high)
    except (KeyError, OverflowError, TypeError, ValueError):
        return None
