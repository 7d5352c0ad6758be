"""Whether a gap and a fault that the detector tells are one and the same: both are said once."""

from collections.abc import Iterable
from dataclasses import dataclass

from wetwell.sim2real.diagnosis.report import FoundEffect

METERS = {"flow_meter": "flow_m3h", "head_sensor": "head_m", "power_meter": "power_kw"}
"""Column of a pump that a component measures."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ToldFault:
    """A fault that the detector tells: `asset` as in its verdicts; `to_ns` is None while it stands."""

    asset: str
    since_ns: int
    to_ns: int | None = None

    def reaches(self, start_ns: int, end_ns: int) -> bool:
        """Whether it stood at any time of a span."""
        return self.since_ns < end_ns and (self.to_ns is None or self.to_ns > start_ns)


def asset_of(
    effect: FoundEffect | None, component: str, faults: Iterable[ToldFault], start_ns: int, end_ns: int
) -> str | None:
    """Asset as whose fault the detector tells a gap, if it does within a span.

    Parameters
    ----------
    effect : FoundEffect or None
        What the gap is called; without it the component counts.
    component : str
        The one held responsible.
    """
    return next(
        (
            fault.asset
            for fault in faults
            if fault.reaches(start_ns, end_ns) and _is_of(fault.asset, effect, component)
        ),
        None,
    )


def _is_of(asset: str, effect: FoundEffect | None, component: str) -> bool:
    """Whether an effect is at an asset; one of all pumps or mains is at each of them."""
    kind, _, name = asset.partition(":")
    if kind == "main":
        return component == "rising_main"
    if kind == "pump":
        return component in {"pump", "drive"} and _number(effect, "pump") in {0, int(name)}
    if component == "level_sensor":
        return name == "level_m"
    return component in METERS and name.endswith(METERS[component])


def _number(effect: FoundEffect | None, name: str) -> int:
    """Number of the pump of an effect; 0 for all."""
    fitted = None if effect is None else effect.parameters.get(name)
    return int(fitted.value) if fitted is not None else 0
