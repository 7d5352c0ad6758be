"""Gap on a recording that the diagnosis has never seen: another weather, other noise, the same truth."""

from collections.abc import Mapping

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.quantities import PUMP_METERS, pump_column
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Sensors

ASINH_SCALE = 5.0
SMALLEST_SHARE = 0.05
"""Noise at the least, as that of so large a share of the largest reading: small readings in ramps do not rule."""
NOTHING = 0.02
"""Gap over the floor under which there is nothing to shrink."""


def whitened(predicted: Recording, recorded: Recording, sensors: Sensors) -> dict[str, Floats]:
    """Residuals over their sensor's noise, by column; of pumps only where the recording reads other than 0."""
    noise = {"flow_m3h": sensors.flow_noise, "head_m": sensors.head_noise, "power_kw": sensors.power_noise}
    residuals = {
        "level_m": (predicted.column("level_m") - recorded.column("level_m")) / max(sensors.level_noise_m, 1e-6)
    }
    for i in range(1, recorded.pumps + 1):
        for signal, share in noise.items():
            reading, said = recorded.column(pump_column(i, signal)), predicted.column(pump_column(i, signal))
            alive = (reading != 0.0) | (said != 0.0)
            scale = np.maximum(np.abs(reading), SMALLEST_SHARE * np.max(np.abs(reading), initial=1e-9))
            residuals[pump_column(i, signal)] = ((said - reading) / (max(share, 1e-6) * scale))[alive]
    return residuals


def gap(residuals: Mapping[str, Floats]) -> float:
    r"""Root mean square over signals of residuals under the asinh loss; noise alone has about 1.

    $$g = \sqrt{\overline{\overline{z'^2}}}, \qquad z' = 5 \operatorname{asinh}(z / 5)$$

    Range 0 to infinity; best: that of the oracle.

    Examples
    --------
    >>> round(gap({"level_m": np.array([1.0, -1.0]), "pump1_flow_m3h": np.zeros(2)}), 2)
    0.7
    """
    by_signal: list[float] = []
    for signal in ("level_m", *PUMP_METERS):
        parts = [values for name, values in residuals.items() if name.endswith(signal)]
        joined = np.concatenate(parts) if parts else np.empty(0)
        joined = joined[np.isfinite(joined)]
        if joined.size:
            by_signal.append(float(np.mean((ASINH_SCALE * np.arcsinh(joined / ASINH_SCALE)) ** 2)))
    return float(np.sqrt(np.mean(by_signal))) if by_signal else float("nan")


def shrinkage(before: float, after: float, floor: float) -> float | None:
    """Share of the gap over the oracle's that is gone; 1 is as good as the oracle. None without a gap to shrink."""
    return (before - after) / (before - floor) if before - floor > NOTHING * floor else None
