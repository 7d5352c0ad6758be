"""A pump of a station file."""

from functools import cached_property
from typing import Annotated, Self

from pydantic import Field, model_validator

from wetwell.protocols.station.curve_fit import fit_error_m, fit_pump_curve
from wetwell.protocols.station.table import Finite, Fraction, Label, NonNegative, Positive, Table

MAX_MISFIT = 0.1
"""Root mean square distance of datasheet points from their curve over its shut-off head, at the most."""


class Pump(Table):
    """One pump: its curve at nominal speed, by coefficients or by datasheet points.

    Parameters
    ----------
    name : str, optional
        What people call it; its number without one.
    main : str, optional
        Name of its rising main; may be left out where there is one.
    curve : (c0, c1, c2), optional
        H = c0 N² + c1 N Q + c2 Q², with N = 1 at nominal frequency. [m, m/(m³/h), m/(m³/h)²]
    points : sequence of (flow_m3h, head_m), optional
        Instead of `curve`: points of its datasheet. [m³/h, m]
    power_points : sequence of (flow_m3h, power_kw), optional
        Shaft power (P2 of a datasheet) at nominal speed. One point gives the size of the power, two or more also how
        it grows with the flow. [m³/h, kW]
    efficiency_points : sequence of (flow_m3h, share), optional
        Instead of `power_points`: efficiency of the pump without its motor at nominal speed. [m³/h, 1]
    nominal_frequency_hz : float
        Frequency for which the curve is given. [Hz]
    """

    name: Label | None = None
    main: Label | None = None
    curve: tuple[Finite, Finite, Finite] | None = None
    points: tuple[tuple[NonNegative, Finite], ...] | None = None
    power_points: Annotated[tuple[tuple[NonNegative, Positive], ...], Field(min_length=1)] | None = None
    efficiency_points: Annotated[tuple[tuple[Positive, Fraction], ...], Field(min_length=1)] | None = None
    nominal_frequency_hz: Positive = 50.0

    @model_validator(mode="after")
    def _check_curve(self) -> Self:
        if (self.curve is None) == (self.points is None):
            raise ValueError("give either 'curve' or 'points'")
        c0, c1, c2 = self.coefficients
        if c0 <= 0:
            raise ValueError(f"curve: shut-off head c0 must be positive, got {c0:g} m")
        if c1 > 0 or c2 > 0 or c1 + c2 == 0:
            raise ValueError(f"curve: head must fall with flow (c1 <= 0, c2 <= 0), got c1 = {c1:g}, c2 = {c2:g}")
        misfit_m = fit_error_m(self.points, self.coefficients) if self.points else 0.0
        if misfit_m > MAX_MISFIT * c0:
            raise ValueError(
                f"points: the best falling curve misses them by {misfit_m:.3g} m, more than {MAX_MISFIT:.0%} of its "
                f"shut-off head of {c0:.3g} m; is a point [flow_m3h, head_m], and does the head fall?"
            )
        if self.power_points is not None and self.efficiency_points is not None:
            raise ValueError("give either 'power_points' or 'efficiency_points'")
        if self.power_points is not None and all(flow_m3h == 0.0 for flow_m3h, _ in self.power_points):
            raise ValueError("power_points: at least one flow above 0 is needed")
        for flow_m3h, _ in self.efficiency_points or ():
            if c0 + (c1 + c2 * flow_m3h) * flow_m3h <= 0.0:
                raise ValueError(f"efficiency_points: the curve makes no head at {flow_m3h:g} m³/h")
        return self

    @cached_property
    def coefficients(self) -> tuple[float, float, float]:
        """(c0, c1, c2) of H = c0 N² + c1 N Q + c2 Q², Q in m³/h."""
        if self.curve is not None:
            return self.curve
        return fit_pump_curve(self.points or ())
