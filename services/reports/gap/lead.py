"""What an engineer reads first of a diagnosis: what, where, how large, how sure."""

import numpy as np

from wetwell.services.reports.charts import percent
from wetwell.sim2real.diagnosis.diagnosis import Diagnosis
from wetwell.sim2real.diagnosis.report import FoundEffect, GapReport
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.replay import Prediction

FULL_SPEED = 0.995
"""Share of a pump's highest frequency from which it runs at full speed."""
SEEN = 0.001
"""Share of a signal under which a difference is not told."""
NAMES_OF = {"flow_m3h": ("flow", "m³/h"), "head_m": ("head", "m"), "power_kw": ("power", "kW")}


def lead(report: GapReport, diagnosis: Diagnosis) -> str:
    """One sentence: what, where, how large in physical units, how sure."""
    sizes = _sizes(differences(diagnosis.traces, diagnosis.replay.run()))
    where = " or the ".join(diagnosis.suspects).replace("_", " ")
    sure = f"with a probability of {percent(report.posterior[0].probability)}" if report.posterior else "as it seems"
    if report.verdict == "none":
        seen = f": at full speed it has {sizes}" if sizes else ""
        return f"Station {report.station} runs as its simulator says, but for what does not matter, {sure}{seen}."
    seen = f": at full speed it has {sizes} than its simulator says" if sizes else ""
    if report.verdict == "unknown":
        return (
            f"Something in the {where} of station {report.station} is otherwise than its file says, and no effect of "
            f"the library explains it, {sure}{seen}."
        )
    told = " and ".join(_told(effect) for effect in report.effects)
    return f"In the {where} of station {report.station} there is {told}, {sure}{seen}."


def shrinkage_words(report: GapReport) -> str:
    """How much of the gap the effects close."""
    low, high = report.gap.shrinkage_ci
    return (
        f"With it the simulator closes {percent(report.gap.shrinkage)} of the gap (95 % interval {percent(low)} to "
        f"{percent(high)}), on cycles that it was not fitted to. The file station.toml beside this page holds it."
    )


def effect_words(name: str) -> str:
    """Name of an effect or of its parameter, in words."""
    return name.replace("_", " ")


def _sizes(found: dict[str, tuple[float, float]]) -> str:
    """Differences that one can see, in words.

    Examples
    --------
    >>> _sizes({"flow_m3h": (-19.4, -0.097), "head_m": (1.44, 0.055), "power_kw": (0.001, 0.0)})
    'flow 19.4 m³/h (9.7 %) lower and head 1.44 m (5.5 %) higher'
    """
    told = [
        f"{NAMES_OF[name][0]} {abs(value):.3g} {NAMES_OF[name][1]} ({percent(abs(share))}) "
        f"{'higher' if value > 0.0 else 'lower'}"
        for name, (value, share) in found.items()
        if abs(share) >= SEEN
    ]
    return " and ".join(filter(None, [", ".join(told[:-1]), *told[-1:]]))


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
    return f"{effect_words(effect.name)} ({'; '.join(sizes)}){other}".replace("_", " ")
