"""What an act of maintenance has changed, by the severity before and after it."""

from typing import Literal

from wetwell.protocols.messages.verdict import Severity

CHECK_RUNS = 4
"""Runs of an asset after an act until it is judged: as many as a baseline is learnt from at least."""
BACK_SHARE = 0.1
"""Of the limit: what is less is as in health."""
ANEW_WORDS = ("calibrated", "replaced", "new ")
"""Of an act after which a meter or a part is another one, so that there is nothing to compare with."""

Change = Literal["back", "better", "no change"]


def change_of(before: Severity, after: Severity) -> Change:
    """Whether an asset is back to what it was in health, better than before, or neither.

    Back: within a tenth of its limit, or not told from health with 95 %. Better: smaller by more than both intervals
    together leave open.

    Examples
    --------
    >>> def friction(value):
    ...     interval = value - 1.0, value + 1.0
    ...     return Severity(quantity="friction_rise_percent", value=value, interval=interval, limit=15.0)
    >>> [change_of(friction(12.0), friction(value)) for value in (1.2, 6.0, 11.5, 14.0)]
    ['back', 'better', 'no change', 'no change']
    >>> change_of(friction(1.0), friction(1.1))
    'no change'
    """
    size_before, half_before = _share(before)
    size_after, half_after = _share(after)
    fell = abs(size_before) - abs(size_after)
    if fell <= (half_before**2 + half_after**2) ** 0.5:
        return "no change"
    return "back" if abs(size_after) <= max(BACK_SHARE, half_after) else "better"


def is_anew(asset: str, act: str) -> bool:
    """Whether after an act the healthy pump has to be learnt anew.

    Examples
    --------
    >>> is_anew("sensor:pump2_flow_m3h", "calibrated"), is_anew("pump:1", "impeller replaced")
    (True, True)
    >>> is_anew("pump:1", "pulled"), is_anew("sensor:level_m", "calibrated")
    (False, False)
    """
    is_of_pump = asset.startswith(("pump:", "sensor:pump"))
    return is_of_pump and any(word in f"{act} ".lower() for word in ANEW_WORDS)


def _share(severity: Severity) -> tuple[float, float]:
    """Size and half of its 95 % interval, as shares of the limit."""
    low, high = severity.interval
    return severity.value / severity.limit, 0.5 * (high - low) / severity.limit
