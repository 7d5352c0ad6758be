"""Sizes under which a difference between a station and its simulator is no reason to act."""

from wetwell.protocols.station.table import Positive, Table


class Materiality(Table):
    """What counts as no difference: a diagnosis names nothing that stays under it, however significant.

    Shares are of the reading, and of half of that at the duty point where it is lower. The share of the flow also
    stands for the balance of the wet well. `time_s` is how late or early a signal may be while it moves.
    """

    flow_share: Positive = 0.01
    head_share: Positive = 0.01
    power_share: Positive = 0.01
    level_m: Positive = 0.005
    threshold_m: Positive = 0.01
    time_s: Positive = 0.1
