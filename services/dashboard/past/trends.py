"""What charts draw of the past: columns of samples, short, with times in ms."""

from wetwell.protocols.messages.history import History
from wetwell.protocols.quantities import PUMP_ANALOGUES, STATION_QUANTITIES
from wetwell.services.dashboard.view.sample_row import NS_PER_MS, number

_DRAWN = (*STATION_QUANTITIES, *PUMP_ANALOGUES)
_EDGES = ("_min", "_max")


def trends_text(history: History) -> str:
    """JSON of `time` in ms since 1970 and `columns`, each value with four digits, without columns that are not drawn.

    Examples
    --------
    >>> columns = {"level_m": (1.23456,), "seq": (1,)}
    >>> trends_text(History(station="alpha", kind="samples", time=(1_000_000,), columns=columns))
    '{"time":[1],"columns":{"level_m":[1.235]}}'
    """
    times = ",".join(str(stamp // NS_PER_MS) for stamp in history.time)
    columns = ",".join(
        f'"{name}":[{",".join(map(number, values))}]' for name, values in history.columns.items() if _is_drawn(name)
    )
    return f'{{"time":[{times}],"columns":{{{columns}}}}}'


def _is_drawn(name: str) -> bool:
    for edge in _EDGES:
        name = name.removesuffix(edge)
    return name in _DRAWN or name.partition("_")[2] in PUMP_ANALOGUES
