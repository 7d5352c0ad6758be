"""Flexible regressor of the residuals: the upper bound of what correcting a prediction can gain without a cause."""

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.protocols.quantities import PUMP_METERS, pump_column
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.timestamps import NS_PER_S

RIDGES = (1e-3, 1e-2, 1e-1, 1.0)
"""Strengths of the ridge, as shares of the number of rows; the one that serves the second half of the rows best."""
RUN_SCALES_S = (5.0, 30.0, 200.0, 1000.0)


def corrected(trained_on: Recording, recorded: Recording, predicted: Recording) -> Recording:
    """A prediction, corrected for each pump and signal by what a regressor has learnt on another recording.

    Ridge regression of the residual on all products of two of: a constant, frequency, level, number of running pumps,
    inflow, the prediction itself, and four exponentials of the time since the last start or stop.
    Nothing is corrected where no ridge helps on rows that it has not learnt from.

    Parameters
    ----------
    trained_on, recorded : Recording
        Prediction and recording from which it learns.
    predicted : Recording
        Prediction that it corrects, of another recording.

    References
    ----------
    .. [1] After T. Hastie et al., The Elements of Statistical Learning: ridge regression on a basis expansion.
    """
    columns = dict(predicted.columns)
    for i in range(1, recorded.pumps + 1):
        for signal in PUMP_METERS:
            name = pump_column(i, signal)
            if name not in predicted.columns or name not in recorded.columns:
                continue
            rows = _features(trained_on, i, name)
            residual = recorded.columns[name] - trained_on.columns[name]
            alive = (recorded.columns[name] != 0.0) & np.isfinite(residual) & np.isfinite(rows).all(axis=1)
            if alive.sum() < rows.shape[1]:
                continue
            is_on = predicted.columns[name] != 0.0
            learnt = _learnt(rows[alive], residual[alive], _features(predicted, i, name))
            columns[name] = predicted.columns[name] + np.where(is_on, learnt, 0.0)
    return Recording(time_ns=predicted.time_ns, columns=columns)


def _learnt(rows: Floats, residual: Floats, others: Floats) -> Floats:
    """Residual to be expected for other rows, each feature kept within the range it was learnt on."""
    low, high = rows.min(axis=0), rows.max(axis=0)
    middle, spread = rows.mean(axis=0), rows.std(axis=0) + 1e-9
    design = _products((rows - middle) / spread)
    half = len(design) // 2
    errors = [
        np.mean((residual[half:] - design[half:] @ _weights(design[:half], residual[:half], ridge)) ** 2)
        for ridge in RIDGES
    ]
    best = int(np.argmin(errors))
    if errors[best] >= np.mean(residual[half:] ** 2):
        return np.zeros(len(others))
    seen = (np.clip(others, low, high) - middle) / spread
    return np.asarray(_products(seen) @ _weights(design, residual, RIDGES[best]))


def _weights(design: Floats, residual: Floats, ridge: float) -> Floats:
    normal = design.T @ design + ridge * len(design) * np.eye(design.shape[1])
    return np.asarray(np.linalg.solve(normal, design.T @ residual))


def _features(prediction: Recording, pump: int, name: str) -> Floats:
    on = prediction.column(pump_column(pump, "frequency_hz")) > 0.0
    seconds = (prediction.time_ns - prediction.time_ns[0]) / NS_PER_S
    changed = np.concatenate([[True], on[1:] != on[:-1]])
    since_s = seconds - np.maximum.accumulate(np.where(changed, seconds, 0.0))
    running = sum(prediction.column(pump_column(i, "frequency_hz")) > 0.0 for i in range(1, prediction.pumps + 1))
    return np.column_stack(
        [
            prediction.column(pump_column(pump, "frequency_hz")),
            prediction.column("level_m"),
            np.asarray(running, dtype=np.float64),
            np.nan_to_num(prediction.column("inflow_m3h")),
            prediction.columns[name],
            *(np.exp(-since_s / scale_s) for scale_s in RUN_SCALES_S),
        ]
    )


def _products(rows: Floats) -> Floats:
    full = np.column_stack([np.ones(len(rows)), rows])
    first, second = np.triu_indices(full.shape[1])
    return np.asarray(full[:, first] * full[:, second])
