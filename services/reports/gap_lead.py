"""What an engineer reads first of a diagnosis: what, where, how large, how sure, what to do."""

import numpy as np

from wetwell.sim2real.diagnosis.diagnosis import Diagnosis
from wetwell.sim2real.diagnosis.report import FoundEffect, GapReport
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.replay import Prediction

FULL_SPEED = 0.995
"""Share of a pump's highest frequency from which it runs at full speed."""
NAMES_OF = {"flow_m3h": ("flow", "m³/h"), "head_m": ("head", "m"), "power_kw": ("power", "kW")}


def lead(report: GapReport, diagnosis: Diagnosis) -> str:
    """One or two sentences, with sizes in physical units."""
    before = differences(diagnosis.traces, diagnosis.replay.run())
    sizes = ", ".join(
        f"{NAMES_OF[name][0]} {value:+.3g} {NAMES_OF[name][1]} ({share:+.1%})"
        for name, (value, share) in before.items()
    )
    seen = f" At full speed the station differs from its simulator on average by: {sizes}." if sizes else ""
    where = report.where[0].component.replace("_", " ") if report.where else "station"
    low, high = report.gap.shrinkage_ci
    if report.verdict == "none":
        return f"Station {report.station} runs as its simulator says, but for what its sensors may be off.{seen}"
    if report.verdict == "unknown":
        return (
            f"Something in the {where} of station {report.station} is otherwise than its file says, and no effect of "
            f"the library explains it.{seen}"
        )
    told = " and ".join(_told(effect) for effect in report.effects)
    return (
        f"In the {where} of station {report.station} there is {told}. With it the simulator closes "
        f"{report.gap.shrinkage:.0%} of the gap on cycles that it was not fitted to (95 % interval {low:.0%} to "
        f"{high:.0%}).{seen}"
    )


def differences(traces: Traces, predicted: Prediction) -> dict[str, tuple[float, float]]:
    """Mean of measured less predicted while pumps run at full speed, and its share of the predicted mean.

    Returns
    -------
    differences : dict
        By signal of the pumps: in its unit, and as a share. Signals that are not measured are left out.
    """
    frequency_hz = traces.frequency_hz
    is_full = (frequency_hz >= FULL_SPEED * frequency_hz.max()) & (frequency_hz > 0.0) & traces.is_row
    found: dict[str, tuple[float, float]] = {}
    for name, measured in traces.signals.items():
        said = predicted.signals[name]
        rows = is_full & np.isfinite(measured) & np.isfinite(said)
        if name in NAMES_OF and rows.any():
            mean = float(np.mean(measured[rows] - said[rows]))
            found[name] = mean, mean / max(abs(float(np.mean(said[rows]))), 1e-9)
    return found


def _told(effect: FoundEffect) -> str:
    """An effect with its sizes and intervals in words."""
    sizes = [
        f"{name.replace('_', ' ')} {one.value if isinstance(one.value, str) else format(one.value, '.3g')}"
        + ("" if one.unit in {"", "1"} else f" {one.unit}")
        + ("" if one.ci is None else f", 95 % interval {one.ci[0]:.3g} to {one.ci[1]:.3g}")
        for name, one in effect.parameters.items()
    ]
    other = (
        f", or {' or '.join(effect.equivalent)}, which these data cannot tell from it" if effect.equivalent else ""
    )
    return f"{effect.name.replace('_', ' ')} ({'; '.join(sizes)}){other}".replace("_", " ")
