"""What a diagnosis cannot tell for want of data."""

import numpy as np

from wetwell.sim2real.recording.traces import Traces

WITHOUT = {
    "inflow_m3h": "no inflow: errors of the balance are unseen; what the level does in few cycles is taken for rain",
    "level_m": "no level: nothing can be said of sump, controller and level sensor",
    "flow_m3h": "no flow: pump, rising main and head sensor are hard to tell apart",
    "head_m": "no head: pump, rising main and flow meter are hard to tell apart",
    "power_kw": "no power: nothing can be said of the power",
}
"""What a diagnosis cannot tell without a quantity."""
PARTS = "the recording is long: parts of it, spread over all, were diagnosed"


def limitations(traces: Traces) -> tuple[str, ...]:
    """Notes on what is not measured, and on what of a long recording was not looked at."""
    measured: set[str] = {*traces.signals, *(("inflow_m3h",) if traces.inflow_m3h is not None else ())}
    measured |= {"level_m"} if np.isfinite(traces.level_m).any() else set()
    is_in_parts = float(traces.time_s[-1]) + 1.0 > traces.seconds
    return tuple(text for name, text in WITHOUT.items() if name not in measured) + ((PARTS,) if is_in_parts else ())
