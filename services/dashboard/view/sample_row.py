"""A sample as a line of JSON that is short: what charts and overview are made of."""

import math
from collections.abc import Sequence

from wetwell.protocols.messages.history import History
from wetwell.protocols.messages.message import Number
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.quantities import PUMP_ANALOGUES, STATION_QUANTITIES, pump_column

NS_PER_MS = 1_000_000


def number(value: Number) -> str:
    """JSON of a value with four digits, `null` for none.

    Examples
    --------
    >>> number(25.71834), number(None), number(float("nan"))
    ('25.72', 'null', 'null')
    """
    return "null" if value is None or not math.isfinite(value) else f"{value:.4g}"


def sample_row(sample: Sample) -> str:
    """JSON array: time in ms since 1970, level, inflow, then frequency, flow, head and power of each pump.

    Examples
    --------
    >>> from wetwell.protocols.messages.sample import PumpReading
    >>> pump = PumpReading(frequency_hz=50.0, flow_m3h=201.23, head_m=26.1)
    >>> sample_row(Sample(station="alpha", seq=0, time=1_000_000_000, level_m=1.2, pumps=(pump,)))
    '[1000,1.2,null,50,201.2,26.1,null]'
    """
    values = [number(sample.level_m), number(sample.inflow_m3h)]
    for pump in sample.pumps:
        values += (number(pump.frequency_hz), number(pump.flow_m3h), number(pump.head_m), number(pump.power_kw))
    return f"[{sample.time // NS_PER_MS},{','.join(values)}]"


def past_rows(history: History) -> list[str]:
    """Rows as of `sample_row` from what the historian tells of samples; `null` where it has no such column.

    Examples
    --------
    >>> columns = {"level_m": (1.2,), "pump1_frequency_hz": (50.0,), "pump1_flow_m3h": (201.23,)}
    >>> past_rows(History(station="alpha", kind="samples", time=(1_000_000_000,), columns=columns))
    ['[1000,1.2,null,50,201.2,null,null]']
    """
    pumps = sum(name.endswith("_frequency_hz") for name in history.columns)
    names = [*STATION_QUANTITIES]
    names += [pump_column(pump, name) for pump in range(1, pumps + 1) for name in PUMP_ANALOGUES]
    columns = [history.columns.get(name, (None,) * len(history.time)) for name in names]
    rows = zip(history.time, *columns, strict=False)  # a foreign answer may be ragged
    return [f"[{time_ns // NS_PER_MS},{','.join(map(number, values))}]" for time_ns, *values in rows]


def live_figures(sample: Sample) -> str:
    """JSON of level, flow and power of the station and the numbers of its running pumps, without brackets."""
    flows = [pump.flow_m3h for pump in sample.pumps if pump.flow_m3h is not None]
    powers = [pump.power_kw for pump in sample.pumps if pump.power_kw is not None]
    running = ",".join(str(place) for place, pump in enumerate(sample.pumps, start=1) if is_running(sample, place))
    flow_m3h = sum(flows) if flows else None
    power_kw = sum(powers) if powers else None
    return f"{number(sample.level_m)},{number(flow_m3h)},{number(power_kw)},[{running}]"


def is_running(sample: Sample, pump: int) -> bool:
    """Whether a pump (from 1) turns; by its frequency where it does not say so."""
    reading = sample.pumps[pump - 1]
    return reading.running if reading.running is not None else (reading.frequency_hz or 0.0) > 0.0


def thinned(samples: list[Sample], most: int) -> list[Sample]:
    """At most so many of the samples, evenly spaced, with the last one."""
    return [samples[place] for place in spaced(len(samples), most)]


def spaced(count: int, most: int) -> Sequence[int]:
    """At most so many of the places from 0 on, evenly spaced, with the last one.

    Examples
    --------
    >>> list(spaced(3, 8)), spaced(10, 3), list(spaced(0, 3))
    ([0, 1, 2], [3, 6, 9], [])
    """
    if count <= most:
        return range(count)
    return [count - 1 - place * count // most for place in range(most)][::-1]
