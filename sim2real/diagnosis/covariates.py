"""What the residual of a signal goes with: level, time in the run, speed, time of day, flow."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.diagnosis.diagnosis import Diagnosis
from wetwell.sim2real.recording.seconds import filled

CLASSES = 20
POINTS = 1500


@dataclass(frozen=True, slots=True, kw_only=True)
class Covariate:
    """A covariate at the bins of the validation of one signal, with the residuals there before and after."""

    name: str
    values: Floats
    before: Floats
    after: Floats


def best_covariate(diagnosis: Diagnosis, signal: int) -> Covariate:
    """The covariate whose classes explain most of the residual of a signal, at no more than `POINTS` bins.

    Parameters
    ----------
    signal : int
        Index into `SIGNALS`.
    """
    bins, found, traces = diagnosis.bins, diagnosis.attribution, diagnosis.traces
    rows = np.flatnonzero(found.validation & (bins.signal == signal) & (np.abs(found.plain) + bins.floor > 0.1))
    rows = rows[:: max(rows.size // POINTS, 1)]
    second = bins.second[rows]
    level_m = filled(traces.level_m, traces.seconds, 0.0)
    running = traces.frequency_hz.max(axis=0)
    began = np.maximum.accumulate(np.where(np.r_[True, np.diff(running > 0.0)], np.arange(traces.seconds), 0))
    choices = {
        "level in m": level_m[second],
        "seconds since the last switch": (second - began[second]).astype(np.float64),
        "frequency in Hz": running[second],
        "hour of the day": ((traces.start_ns / 1e9 + traces.time_s[second]) % 86_400.0) / 3600.0,
        "slope of the level in mm/s": 1000.0 * np.gradient(_smooth(level_m))[second],
    }
    before = found.plain[rows]
    name = max(choices, key=lambda key: _explained(choices[key], before))
    return Covariate(name=name, values=choices[name], before=before, after=found.after[rows])


def _smooth(values: Floats) -> Floats:
    return np.convolve(values, np.full(31, 1.0 / 31.0), mode="same")


def _explained(values: Floats, residuals: Floats) -> float:
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, CLASSES + 1)[1:-1])) if values.size else np.zeros(0)
    group = np.searchsorted(edges, values)
    sums, counts = np.bincount(group, residuals), np.bincount(group)
    return float(np.sum(sums**2 / np.maximum(counts, 1)))
