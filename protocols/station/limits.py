"""Action limits of a station: how bad a fault may become before somebody has to act."""

from wetwell.protocols.station.table import Positive, Table


class Limits(Table):
    """Severities at which a crew has to go; half of one is when its visit is planned.

    Attributes
    ----------
    speed_loss_percent, wear_head_percent : float
        Of a pump: loss of effective speed, as by rags, and of head at the flow of the run, as by wear. One operating
        point shows the same shift for both, so the limit counts that is nearer. [%]
    friction_rise_percent, static_head_rise_m : float
        Of a main: rise of k, or of the static head where runs at several flows say that this is what has moved.
        A fall by as much, as at a burst, counts as well. [%, m]
    meter_error_percent : float
        Of a meter: relative error. [%]
    """

    speed_loss_percent: Positive = 3.0
    wear_head_percent: Positive = 5.0
    friction_rise_percent: Positive = 15.0
    static_head_rise_m: Positive = 0.8
    meter_error_percent: Positive = 5.0
