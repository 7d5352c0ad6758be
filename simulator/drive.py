"""Variable-frequency drive: soft start, soft stop, reversal in mid-ramp, dwell."""

from wetwell.simulator.jit import compiled

ROUNDING_HZ = 1e-9
"""Far above the rounding of a ramp's sum, far under any drive's resolution."""


@compiled
def next_frequency_hz(
    frequency_hz: float, is_commanded: bool, rate_hz_s: float, minimum_hz: float, nominal_hz: float, dwell_s: float
) -> float:
    """Frequency one second later.

    Commanded, the drive goes from `minimum_hz` to `nominal_hz` at `rate_hz_s`; otherwise back to `minimum_hz`, where
    it stays while a dwell is left, then to zero. A command that changes in mid-ramp turns the ramp around.

    Examples
    --------
    >>> next_frequency_hz(0.0, True, 5.0, 20.0, 50.0, 0.0)
    25.0
    >>> next_frequency_hz(23.0, False, 5.0, 20.0, 50.0, 2.0)
    20.0
    >>> next_frequency_hz(20.0, False, 5.0, 20.0, 50.0, 0.0)
    0.0
    """
    if is_commanded:
        risen_hz = max(frequency_hz, minimum_hz) + rate_hz_s
        return risen_hz if risen_hz < nominal_hz - ROUNDING_HZ else nominal_hz
    if frequency_hz > minimum_hz:
        fallen_hz = frequency_hz - rate_hz_s
        return fallen_hz if fallen_hz > minimum_hz + ROUNDING_HZ else minimum_hz
    return minimum_hz if dwell_s > 0.0 and frequency_hz > 0.0 else 0.0
