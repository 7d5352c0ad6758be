"""The end of a station's history: its newest samples, and not a stamp that lies far ahead of all others."""

from collections.abc import Iterable

from wetwell.services.historian.store.interface import DAY_NS

LEAST_SAMPLES = 10
"""So many make a stretch of time that is believed, as the detector's gate follows a clock after ten that agree."""

MOST_LOOKED_AT = 100
"""Rows from the newest on in which it is looked for."""


def end_of_stretch_ns(rows: Iterable[tuple[int, int, int]]) -> int | None:
    """End of the newest stretch of samples that is believed.

    Parameters
    ----------
    rows : iterable of (int, int, int)
        First time, last time and number of samples of each row of a station, the newest row first. Only as many are
        taken as are needed.

    Returns
    -------
    end_ns : int, optional
        A stretch has no pause of more than a day, and at least `LEAST_SAMPLES`. Where none has as many, that of the
        one with the most samples, of such the newest; None without any.

    Examples
    --------
    >>> day = DAY_NS
    >>> rows = [(900 * day, 900 * day, 1), *((10 * day - second, 10 * day - second, 1) for second in range(10))]
    >>> end_of_stretch_ns(rows) == 10 * day
    True
    """
    most, believed_ns = 0, None
    begin_ns = end_ns = samples = 0
    for first_ns, last_ns, size in rows:
        if not samples or begin_ns - last_ns > DAY_NS:
            begin_ns, end_ns, samples = first_ns, last_ns, 0
        begin_ns, samples = min(begin_ns, first_ns), samples + size
        if samples > most:
            most, believed_ns = samples, end_ns
        if samples >= LEAST_SAMPLES:
            break
    return believed_ns
