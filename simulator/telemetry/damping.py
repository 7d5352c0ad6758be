"""Damping of a sensor: first-order lags, exact for a value that moves evenly within each second."""

import math
from dataclasses import replace

from wetwell.simulator.parameters import SensorParameters


def damped_by(sensor: SensorParameters, lag_s: float, second_share: float) -> SensorParameters:
    r"""The sensor with a lag, of which a second filter in a row takes a share.

    What comes in moves evenly from u₀ to u within a second, as both filters see it exactly:

    $$x_1 = u + (x_0 - u)\, e^{-1/\tau_1} + (u_0 - u)\, l_x, \qquad
    y_1 = u + (y_0 - u)\, e^{-1/\tau_2} + (x_0 - u)\, c + (u_0 - u)\, l_y$$

    $$c = \frac{1}{\tau_2} \int_0^1 e^{-t/\tau_1} e^{-(1 - t)/\tau_2}\, dt, \qquad
    l_x = \tau_1 (1 - e^{-1/\tau_1}) - e^{-1/\tau_1}, \qquad
    l_y = \tau_1 + \tau_2 - \frac{\tau_1^2 e^{-1/\tau_1} - \tau_2^2 e^{-1/\tau_2}}{\tau_1 - \tau_2}
    - e^{-1/\tau_2} - c$$

    Parameters
    ----------
    sensor : SensorParameters
    lag_s : float
        τ₁ + τ₂. [s]
    second_share : float
        τ₂ over both; at most .5. [1]
    """
    first_s, second_s = (1.0 - second_share) * lag_s, second_share * lag_s
    followed, followed_again = followed_share(first_s), followed_share(second_s)
    late = first_s * followed - (1.0 - followed)
    carried = late_again = 0.0
    if second_s > 0.0:
        faster = 1.0 / second_s - 1.0 / first_s
        carried = (followed_again - followed) / faster if faster > 1e-6 else 1.0 - followed_again
        carried /= second_s
        late_again = lag_s - _kept_s(first_s, second_s) - (1.0 - followed_again) - carried
    return replace(
        sensor, followed=followed, followed_again=followed_again, carried=carried, late=late, late_again=late_again
    )


def _kept_s(first_s: float, second_s: float) -> float:
    """What two filters in a row still keep of their lag a second after a value began to move. [s]."""
    if first_s - second_s < 1e-4 * first_s:
        middle_s = 0.5 * (first_s + second_s)
        return (2.0 * middle_s + 1.0) * math.exp(-1.0 / middle_s)
    squares = [lag_s**2 * (1.0 - followed_share(lag_s)) for lag_s in (first_s, second_s)]
    return (squares[0] - squares[1]) / (first_s - second_s)


def followed_share(lag_s: float) -> float:
    r"""Share of a step that a first-order lag follows within a second.

    $$1 - e^{-1 / \tau}$$

    Examples
    --------
    >>> followed_share(0.0), round(followed_share(10.0), 4)
    (1.0, 0.0952)
    """
    return 1.0 if lag_s <= 0.0 else 1.0 - math.exp(-1.0 / lag_s)
