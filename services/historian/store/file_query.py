"""Sums over daily files by DuckDB, without reading them into this process's arrays or holding its lock."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import duckdb
import numpy as np

from wetwell.protocols.quantities import columns_of, pumps_of
from wetwell.services.historian.store.interface import StoreError
from wetwell.services.historian.summary import Summary

Named = Literal["samples", "minutes"]
"""Forms of daily files whose columns have the names of quantities."""

_FIGURES: dict[Named, str] = {
    "samples": 'count("{0}"), avg("{0}"), min("{0}"), max("{0}")',
    "minutes": 'coalesce(sum("{0}_count"), 0), sum("{0}" * "{0}_count") / sum("{0}_count"), min("{0}_min"), '
    'max("{0}_max")',
}


def summary_of_files(
    form: Named, paths: Sequence[Path], start_ns: int, end_ns: int, origin_ns: int, span_ns: int
) -> Summary:
    """Summary of the rows from `start_ns` until before `end_ns` over equal spans from `origin_ns` on.

    Raises
    ------
    StoreError
        If a file cannot be read, be it that it has just gone.
    """
    files = [str(path) for path in paths]
    try:
        with duckdb.connect() as database:
            known = database.execute(
                "DESCRIBE SELECT * FROM read_parquet(?, union_by_name = true)", [files]
            ).fetchall()
            names = columns_of(pumps_of(column[0] for column in known))
            figures = ", ".join(_FIGURES[form].format(name) for name in names)
            columns = database.execute(
                f"SELECT (epoch_ns(time) - $origin) // $span AS span, {figures} "  # noqa: S608 - names of columns_of
                "FROM read_parquet($files, union_by_name = true) "
                "WHERE epoch_ns(time) >= $start AND epoch_ns(time) < $end GROUP BY span ORDER BY span",
                {"files": files, "origin": origin_ns, "span": span_ns, "start": start_ns, "end": end_ns},
            ).fetchnumpy()
    except duckdb.Error as error:
        raise StoreError(f"daily files: {next(iter(str(error).splitlines()), 'cannot be read')}") from error
    span, *arrays = (np.ma.filled(_floats(array), np.nan) for array in columns.values())
    count, mean, low, high = (np.stack(arrays[place::4], axis=1) for place in range(4))
    return Summary(
        time_ns=np.array([origin_ns + int(number) * span_ns for number in span.tolist()], dtype=np.int64),
        count=count,
        mean=mean,
        low=low,
        high=high,
    )


def _floats(array: Any) -> Any:
    return np.ma.asarray(array).astype(np.float64)
