"""SKAB, the Skoltech Anomaly Benchmark: a pump test rig with valves."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv

from wetwell.protocols.errors import RecordingError
from wetwell.protocols.recordings.recording import Recording

LITRES_PER_MINUTE_M3H = 0.06
FLOW_COLUMN = "Volume Flow RateRMS"
LABELS = {"anomaly": "truth_anomaly", "changepoint": "truth_changepoint"}


def read_skab(path: Path) -> Recording:
    """Recording of one SKAB file: the flow of one pump, in m³/h, and the labels as truth columns.

    The rig has neither drive frequency, nor suction pressure, nor tank level, and its pressure takes only ten values,
    so that there is no head. Times are taken as UTC.

    Raises
    ------
    RecordingError
        If the file cannot be read or has not the columns of SKAB.

    References
    ----------
    .. [1] I. Katser, V. Kozitsin, Skoltech Anomaly Benchmark (SKAB), Kaggle, 2020, doi 10.34740/KAGGLE/DSV/1693952.
    """
    try:
        table = pa.csv.read_csv(path, parse_options=pa.csv.ParseOptions(delimiter=";"))
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from error
    except pa.ArrowInvalid as error:
        raise RecordingError(f"{path}: {str(error).splitlines()[0]}") from error
    for name in ("datetime", FLOW_COLUMN):
        if name not in table.column_names:
            raise RecordingError(f"{path}: column '{name}' is missing, is this a SKAB file?")
    if table["datetime"].null_count:
        row = int(np.argmax(table["datetime"].is_null().to_numpy())) + 1
        raise RecordingError(f"{path}: column 'datetime', row {row}: is empty")
    try:
        stamps = table["datetime"].cast(pa.timestamp("ns")).cast(pa.int64()).to_numpy()
        flow_l_min = table[FLOW_COLUMN].cast(pa.float64()).to_numpy()
        truth = {
            truth: table[name].cast(pa.float64()).to_numpy()
            for name, truth in LABELS.items()
            if name in table.column_names
        }
    except pa.ArrowException as error:
        raise RecordingError(f"{path}: {str(error).splitlines()[0]}") from error
    return Recording(time_ns=stamps, columns={"pump1_flow_m3h": LITRES_PER_MINUTE_M3H * flow_l_min}, truth=truth)
