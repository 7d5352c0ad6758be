"""Zenoh key expressions: `wetwell/{station}/...`, one function a kind of message."""

ROOT = "wetwell"
SITE = "_site"
"""In place of a station: a service that is there for all of them."""
PACE = f"{ROOT}/@pace"
"""Nothing lives here: a router that is asked for it has taken all that was declared before."""


def sample_key(station: str) -> str:
    """Key of the samples of a station, one message a second."""
    return f"{ROOT}/{station}/sample"


def sample_block_key(station: str) -> str:
    """Key of the samples of a station, many in a message."""
    return f"{ROOT}/{station}/samples"


def verdict_key(station: str, pump: int | str = "*") -> str:
    """Key of the verdicts on one pump (from 1), or of all pumps of the station."""
    return f"{ROOT}/{station}/verdict/{pump}"


def order_key(station: str) -> str:
    """Key of the orders of operators to the detector of a station."""
    return f"{ROOT}/{station}/order/detector"


def maintenance_act_key(station: str) -> str:
    """Key of acts of maintenance that were entered, for the detector of a station."""
    return f"{ROOT}/{station}/order/maintenance"


def maintenance_key(station: str) -> str:
    """Key of the log of maintenance of a station, with what the detector saw of each act."""
    return f"{ROOT}/{station}/maintenance"


def status_key(station: str, service: str) -> str:
    """Key of the health figures of one service of a station."""
    return f"{ROOT}/{station}/status/{service}"


def alive_key(station: str, service: str) -> str:
    """Key of the liveliness token of one service of a station."""
    return f"{ROOT}/{station}/alive/{service}"


def plant_clock_key(station: str) -> str:
    """Key of the orders to the clock of a simulated plant, which are questions."""
    return f"{ROOT}/{station}/plant-clock"


def model_key(station: str) -> str:
    """Key of the curves that the detector believes in."""
    return f"{ROOT}/{station}/model"


def gap_key(station: str) -> str:
    """Key of the watched gap between a station and its simulator."""
    return f"{ROOT}/{station}/gap"


def alarm_key(station: str, alarm: str = "*") -> str:
    """Key of one alarm, or of all alarms of a station."""
    return f"{ROOT}/{station}/alarm/{alarm}"


def alarm_act_key(station: str) -> str:
    """Key of the acts of operators on the alarms of a station, which are questions."""
    return f"{ROOT}/{station}/alarm-act"


def alarm_report_key() -> str:
    """Key of the question for rates, chattering and stale alarms of the whole site."""
    return f"{ROOT}/{SITE}/alarm-report"


def history_key(station: str) -> str:
    """Key of the questions to the historian about a station."""
    return f"{ROOT}/{station}/history"


def plan_key(shard: int) -> str:
    """Key of the plan of a shard of the fleet."""
    return f"{ROOT}/{SITE}/plan/{shard}"


def tail_key(key: str) -> str:
    """Key on which the publisher of a key says which message was its last; `*` and `**` do not match its end.

    Examples
    --------
    >>> tail_key(sample_key("alpha"))
    'wetwell/alpha/sample/@tail'
    """
    return f"{key}/@tail"
