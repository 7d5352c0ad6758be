"""Sizes under which a difference between a station and its simulator is no reason to act."""

from wetwell.protocols.station.table import Positive, Table


class Materiality(Table):
    """What counts as no difference: a diagnosis names nothing that stays under it, however significant.

    Parameters
    ----------
    flow_share : float
        Share of the reading of the flow, and of half of that at the duty point where it is lower; also for the
        balance of the wet well. [1]
    head_share, power_share : float
        The same for the head and for the power. [1]
    level_m : float
        Difference of the level. [m]
    threshold_m : float
        Difference of the level at which a pump starts or stops. [m]
    time_s : float
        How late or early a signal may be while it moves. [s]
    """

    flow_share: Positive = 0.01
    head_share: Positive = 0.01
    power_share: Positive = 0.01
    level_m: Positive = 0.005
    threshold_m: Positive = 0.01
    time_s: Positive = 0.5
