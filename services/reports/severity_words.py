"""How far a fault has gone, in words for people."""

from collections.abc import Mapping

from wetwell.protocols.messages.verdict import Severity

QUANTITIES: Mapping[str, tuple[str, str]] = {
    "speed_loss_percent": ("speed loss", "%"),
    "wear_head_percent": ("loss of head", "%"),
    "friction_rise_percent": ("friction", "%"),
    "static_head_rise_m": ("static head", "m"),
    "meter_error_percent": ("error", "%"),
}
"""Words and units of severities."""


def severity_words(severity: Severity, digits: int = 3) -> str:
    """Size, interval and limit.

    Examples
    --------
    >>> severity_words(Severity(quantity="wear_head_percent", value=132.4, interval=(128.1, 136.0), limit=5.0))
    'loss of head 132 % (128 to 136), limit 5 %'
    """
    label, unit = QUANTITIES.get(severity.quantity, (severity.quantity, ""))
    low, high = severity.interval
    size = f"{label} {short(severity.value, digits)} {unit} ({short(low, digits)} to {short(high, digits)})"
    return f"{size}, limit {severity.limit:g} {unit}"


def short(value: float, digits: int = 2) -> str:
    """Some digits, as people write them: 540 and not 5.4e+02."""
    return f"{float(f'{value:.{digits}g}'):.15g}"
