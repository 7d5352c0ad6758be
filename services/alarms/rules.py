"""The rule table: what is an alarm, how urgent, after what delays, and what to do."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, get_args
from urllib.parse import unquote

from wetwell.protocols.messages.alarm import Mode, Priority, RuleName
from wetwell.protocols.messages.verdict import AssetFault, Stage, Verdict
from wetwell.protocols.timestamps import to_iso
from wetwell.services.reports.severity_words import QUANTITIES, severity_words, short


@dataclass(frozen=True)
class Rule:
    """One kind of alarm. Delays are in seconds of the station's time."""

    priority: Priority
    text: str
    advice: str
    on_delay_s: float = 0.0
    off_delay_s: float = 0.0
    is_enabled: bool = True
    is_latching: bool = False


RULES: Mapping[RuleName, Rule] = {
    "pump_fault": Rule("high", "pump fault", "pull the pump: look for rags, a worn impeller or wear ring"),
    "system_fault": Rule("high", "system fault", "flush the main: look for deposits, air, a valve that is not open"),
    "pump_and_system_fault": Rule("high", "pump and system fault", "pull the pump and flush the main"),
    "sensor_fault": Rule("medium", "sensor fault", "check the meter before a crew goes out"),
    "model_gap": Rule(
        "advisory", "the station has left its simulator", "see what it is called; wetwell gap diagnose tells more"
    ),
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
"""Defaults; the setting `alarms.rules` changes priority, delays, latching and whether a rule is there at all.

The priority of a fault is the rule's where somebody has to act; `PRIORITIES` has those of the stages before."""
PRIORITIES: Mapping[Stage, Priority] = {"watch": "advisory", "plan": "low"}
RANK: Mapping[Priority, int] = {name: rank for rank, name in enumerate(reversed(get_args(Priority)))}
"""The most urgent first."""

VERDICT_RULES: tuple[RuleName, ...] = ("pump_fault", "system_fault", "pump_and_system_fault", "sensor_fault")
MAX_PUMPS = 32
BY_DESIGN: Mapping[Mode, frozenset[RuleName]] = {
    "maintenance": frozenset({*VERDICT_RULES, "model_gap"}),
    "stopped": frozenset(RULES) - {"overflow_risk"},
}
"""Alarms that a mode of the station suppresses: what a crew does to pumps is no fault; a stopped one may stand and be
silent, but not flood."""


def changed_rules(changes: Mapping[RuleName, Mapping[str, Any]]) -> dict[RuleName, Rule]:
    """The rule table with some fields of some rules changed."""
    return {name: replace(rule, **changes.get(name, {})) for name, rule in RULES.items()}


def alarm_id(rule: RuleName, pump: int | None = None, asset: str | None = None) -> str:
    """Name of an alarm of a station; what cannot stand in a key of the bus is escaped.

    Examples
    --------
    >>> alarm_id("pump_fault", 2), alarm_id("level_high")
    ('pump2.pump_fault', 'level_high')
    >>> alarm_id("system_fault", asset="main:line 1/2"), alarm_id("sensor_fault", asset="sensor:level_m")
    ('main:line 1%2F2.system_fault', 'level_m.sensor_fault')
    """
    if pump is not None:
        return f"pump{pump}.{rule}"
    if asset is None:
        return rule
    name = "".join(f"%{ord(letter):02X}" if letter in "/*$?#%" else letter for letter in asset)
    return f"{name.removeprefix('sensor:')}.{rule}"


def rule_of(asset: str) -> tuple[RuleName, int | None]:
    """Rule of the fault of an asset, and the pump if it is one.

    Examples
    --------
    >>> rule_of("pump:2"), rule_of("main:line 1"), rule_of("sensor:level_m")
    (('pump_fault', 2), ('system_fault', None), ('sensor_fault', None))
    """
    kind, _, name = asset.partition(":")
    if kind == "pump" and name.isdecimal():
        return "pump_fault", int(name)
    return ("system_fault" if kind == "main" else "sensor_fault"), None


def parse_alarm_id(text: str) -> tuple[RuleName, int | None, str | None]:
    """Rule, pump and asset of an alarm's name.

    Raises
    ------
    ValueError
        If no rule has such alarms.

    Examples
    --------
    >>> parse_alarm_id("pump2.pump_fault"), parse_alarm_id("level_high")
    (('pump_fault', 2, 'pump:2'), ('level_high', None, None))
    >>> parse_alarm_id("main:line 1%2F2.system_fault"), parse_alarm_id("level_m.sensor_fault")
    (('system_fault', None, 'main:line 1/2'), ('sensor_fault', None, 'sensor:level_m'))
    """
    prefix, dot, last = text.rpartition(".")
    for rule in RULES:
        if rule == last and (rule in VERDICT_RULES) == bool(dot):
            if not dot:
                return rule, None, None
            number = prefix.removeprefix("pump")
            if prefix.startswith("pump") and number.isdecimal() and 1 <= int(number) <= MAX_PUMPS:
                return rule, int(number), f"pump:{int(number)}" if rule == "pump_fault" else None
            if rule == "system_fault" and prefix.partition(":")[0] == "main":
                return rule, None, unquote(prefix)
            if rule == "sensor_fault" and re.fullmatch(r"[a-z0-9_]+", prefix):
                return rule, None, f"sensor:{prefix}"
    raise ValueError(f"alarm '{text}' is none of {', '.join(RULES)}, of an asset with 'pump2.' or 'main.' before")


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


def fault_text(fault: AssetFault) -> str:
    """What is known of a fault, in one line for an operator.

    Examples
    --------
    >>> from wetwell.protocols.messages.verdict import Severity, Trend
    >>> from wetwell.protocols.timestamps import from_iso
    >>> severity = Severity(quantity="friction_rise_percent", value=8.94, interval=(8.53, 9.3), limit=15.0)
    >>> trend = Trend(per_day=2.88, interval=(2.3, 3.4), reaches_limit=from_iso("2026-11-24T08:00:00Z"))
    >>> fault_text(AssetFault(asset="main", stage="plan", since=0, severity=severity, trend=trend))
    'main: plan, friction 8.9 % (8.5 to 9.3), limit 15 %, 2.9 % a day, limit about 2026-11-24'
    >>> blocked = Severity(quantity="wear_head_percent", value=132.0, interval=(128.0, 136.0), limit=5.0)
    >>> no_growth = Trend(per_day=540.0, interval=(-20.0, 1100.0))
    >>> fault_text(AssetFault(asset="pump:2", stage="act", since=0, severity=blocked, trend=no_growth))
    'pump 2: act, loss of head 130 % (130 to 140), limit 5 %'
    """
    kind, _, name = fault.asset.partition(":")
    words = [f"{name if kind == 'sensor' else f'{kind} {name}'.strip()}: {fault.stage}"]
    if fault.severity is not None:
        words.append(severity_words(fault.severity, digits=2))
        _, unit = QUANTITIES.get(fault.severity.quantity, ("", ""))
        if fault.trend is not None:
            least, most = fault.trend.interval
            if least > 0.0 or most < 0.0:  # else no growth is seen
                words.append(f"{short(fault.trend.per_day)} {unit} a day")
            if fault.trend.reaches_limit is not None:
                words.append(f"limit about {to_iso(fault.trend.reaches_limit)[:10]}")
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
